"""One writer of self-contained HTML pages: one style, and figures, tables and diffs for all."""

from motorctl.html_pages.page import Figure, figure, write_page

__all__ = ["Figure", "figure", "write_page"]
