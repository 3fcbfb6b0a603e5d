"""Makes each picture of the site a link to its file, so that a tap on a phone opens it at full size."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.util.osutil import relative_uri


def add(app: Any, document: nodes.document, page: str) -> None:
    """Put each picture of a page that has no link into a link to its file, and pictures of examples into a box."""
    start = app.builder.get_target_uri(page)
    for image in list(document.findall(nodes.image)):
        is_thumbnail = "/thumb/" in image["uri"]  # it is below a link to its example
        if image["uri"] not in app.env.images or isinstance(image.parent, nodes.reference) or is_thumbnail:
            continue
        target = relative_uri(start, f"_images/{app.env.images[image['uri']][1]}")
        image.replace_self(
            nodes.reference("", "", image.deepcopy(), refuri=target, internal=True, classes=["picture"])
        )
    for image in [node for node in document.findall() if type(node).__name__ == "imgsgnode"]:
        image.replace_self(nodes.container("", image.deepcopy(), classes=["picture"]))
