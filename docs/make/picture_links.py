"""Makes each picture of the site a link to its file, so that a tap on a phone opens it at full size."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.util.osutil import relative_uri


def add(app: Any, document: nodes.document, page: str) -> None:
    """Put each picture of a page that is not yet in a link into a link, and pictures of examples into a box."""
    start = app.builder.get_target_uri(page)
    for image in list(document.findall(nodes.image)):
        if image["uri"] not in app.env.images or isinstance(image.parent, nodes.reference):
            continue
        target = relative_uri(start, f"_images/{app.env.images[image['uri']][1]}")
        image.replace_self(
            nodes.reference("", "", image.deepcopy(), refuri=target, internal=True, classes=["picture"])
        )
    for image in [node for node in document.findall() if type(node).__name__ == "imgsgnode"]:
        image.replace_self(nodes.container("", image.deepcopy(), classes=["picture"]))
