"""Plain-text tables, by which results print themselves."""

from collections.abc import Sequence


def format_table(head: Sequence[str], rows: Sequence[Sequence[str]], *, left: int = 1) -> str:
    """Align columns; the first `left` to the left, the others to the right.

    Parameters
    ----------
    head
        Column titles.
    rows
        Cells as text.
    left
        Number of left-aligned columns.
    """
    table = [list(head), *map(list, rows)]
    widths = [max(len(row[i]) for row in table) for i in range(len(head))]

    def line(row: Sequence[str]) -> str:
        cells = (c.ljust(w) if i < left else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True)))
        return "  ".join(cells).rstrip()

    return "\n".join([line(table[0]), "  ".join("-" * w for w in widths), *map(line, table[1:])])


def number(x: float, digits: int = 5) -> str:
    """A number for a table; NaN, that is "not identified", as a dash."""
    return "-" if x != x else f"{x:.{digits}g}"
