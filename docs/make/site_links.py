"""Check a built site: every link inside it leads to a page, and every anchor to a place on that page.

    python docs/make/site_links.py FOLDER

Prints what leads nowhere and ends with 1 where there is any.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The links of a page, and the places on it that can be linked to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag links to and what it is called."""
        for name, value in attrs:
            if value and (name == "id" or (name == "name" and tag == "a")):
                self.places.add(value)
            elif value and (
                (name == "href" and tag in ("a", "link")) or (name == "src" and tag in ("img", "script"))
            ):
                self.links.append(value)


def broken_links(site: Path) -> list[str]:
    """A line for each link that leads nowhere."""
    # what begins with "_" are the theme's own files, templates among them
    paths = [
        path for path in sorted(site.rglob("*.html")) if not path.relative_to(site).parts[0].startswith("_")
    ]
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in paths}
    found = []
    for path, page in pages.items():
        for link in dict.fromkeys(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            place = unquote(parts.fragment)
            if not target.exists():
                found.append(f"{path.relative_to(site)}: {link} leads to no file")
            elif place and target in pages and place not in pages[target].places:
                found.append(f"{path.relative_to(site)}: {link} leads to no place on that page")
    return found


if __name__ == "__main__":
    folder = Path(sys.argv[1]).resolve()
    broken = broken_links(folder)
    print("\n".join(broken) or f"{len(list(folder.rglob('*.html')))} pages, no broken link")
    sys.exit(bool(broken))
