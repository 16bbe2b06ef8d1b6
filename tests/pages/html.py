"""What a page consists of."""

from html.parser import HTMLParser

VOID = {"meta", "img", "br", "wbr", "input"}


class Elements(HTMLParser):
    """Collects the elements of a page with their attributes, and checks that they close in order.

    `text` is all that can be read, without style and script.
    """

    def __init__(self, html: str) -> None:
        super().__init__()
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(html)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attributes)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("style", "script"):
            self.text += data

    def all(self, tag: str, **wanted: str) -> list[dict[str, str | None]]:
        """Return the attributes of each element of a kind that has the wanted ones."""
        return [
            attributes
            for name, attributes in self.seen
            if name == tag and all(attributes.get(key) == value for key, value in wanted.items())
        ]

    def addresses(self) -> list[str]:
        """Return all that the page loads or leads to."""
        return [
            value
            for _, attributes in self.seen
            for name, value in attributes.items()
            if name in ("src", "href", "srcset", "data", "poster", "action") and value
        ]
