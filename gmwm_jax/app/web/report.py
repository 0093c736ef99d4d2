"""What is taken away: all results as files, a report that is one HTML file, and everything in one archive.

A report loads nothing and runs nothing: figures lie in it as images, and all texts are escaped.
"""

import base64
import html
import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from gmwm_jax._internal.columns import plain_name
from gmwm_jax.app.web import tables
from gmwm_jax.app.web.script import Analysis, python
from gmwm_jax.app.web.snippets import snippets
from gmwm_jax.app.web.tables import Table, to_csv
from gmwm_jax.fitting.result import Fit
from gmwm_jax.inference.bootstrapping import Bootstrap
from gmwm_jax.inference.selection import Selection

FORMATS = ("svg", "pdf", "png")
"""Of figures."""
_WHEN = (1980, 1, 1, 0, 0, 0)
"""Of the files in an archive, so that the same results are the same bytes; the earliest that the format knows."""

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1c1c1c; }
table { border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto; }
th, td { border-bottom: 1px solid #d9d9d9; padding: .2rem .6rem; text-align: left; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; }
pre { white-space: pre-wrap; background: #f4f4f4; padding: .8rem; }
"""


def downloads(
    fits: Sequence[Fit],
    *,
    analysis: Analysis | None = None,
    bootstraps: Sequence[Bootstrap] = (),
    selections: Sequence[Selection] = (),
) -> dict[str, bytes]:
    """Make all files of some fits: tables, figures, JSON, texts for filters, the Python file, and the report.

    Parameters
    ----------
    fits
        One a channel.
    analysis
        What was done, for the Python file; none is made without.
    bootstraps, selections
        Of these fits, where there are some.

    Returns
    -------
    Name -> content. Names are made of plain letters whatever the channels are called.

    Examples
    --------
    >>> from gmwm_jax.app.web import report
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["gyro_x"]))
    >>> [name for name in report.downloads([gj.fit(wv, "WN + RW")]) if name.endswith("_filter.csv")]
    ['1_gyro_x_filter.csv']
    """
    made: dict[str, bytes] = {}
    shown: dict[str, tuple[Figure | None, Table | None]] = {}
    for i, fit in enumerate(fits):
        stem, channel = _stem(i, fit), fit.wv.channels[0]
        _add_table(made, shown, f"{stem}_scales", f"{channel}: wavelet variance", tables.scales(fit.wv))
        _add_figure(made, shown, f"{stem}_fit", f"{channel}: fit", fit.plot())
        _add_table(made, shown, f"{stem}_parameters", f"{channel}: per sample", tables.estimates(fit))
        if fit.rate:
            _add_table(made, shown, f"{stem}_filter", f"{channel}: for a filter", tables.filter(fit))
            _add_table(made, shown, f"{stem}_datasheet", f"{channel}: as a datasheet", tables.datasheet(fit))
    for i, boot in enumerate(bootstraps):
        stem, channel = _stem(i, boot.fit), boot.fit.wv.channels[0]
        _add_figure(made, shown, f"{stem}_bootstrap", f"{channel}: replicates", boot.plot())
        _add_table(made, shown, f"{stem}_bootstrap", f"{channel}: intervals of replicates", tables.bootstrap(boot))
    for i, selection in enumerate(selections):
        stem, channel = _stem(i, selection.superset), selection.superset.wv.channels[0]
        _add_figure(made, shown, f"{stem}_selection", f"{channel}: models", selection.plot())
        _add_table(made, shown, f"{stem}_selection", f"{channel}: ranked models", tables.selection(selection))
    content = [fit.to_dict() for fit in fits]
    made["fit.json"] = json.dumps(content, indent=1, default=lambda v: v.tolist(), allow_nan=False).encode()
    if all(fit.rate for fit in fits):
        made |= {f"filters/{s.file}": s.text.encode() for s in snippets(fits) if s.text}
    program = "" if analysis is None else python(analysis)
    if program:
        made["analysis.py"] = program.encode()
    made["report.html"] = page("Noise of an inertial sensor", shown, program).encode()
    return made


def page(title: str, parts: Mapping[str, tuple[Figure | None, Table | None]], program: str = "") -> str:
    """Write a report as one HTML file.

    Parameters
    ----------
    title
        Of the page.
    parts
        Heading -> a figure, a table, or both.
    program
        The Python file that gives these results, shown at the end; "" for none.

    Examples
    --------
    >>> from gmwm_jax.app.web import report, tables
    >>> table = tables.Table(("<b>",), ("",), ((1.0,),), "one number")
    >>> "<b>" in report.page("A report", {"Numbers": (None, table)})
    False
    """
    sections = []
    for heading, (figure, table) in parts.items():
        text = html.escape(heading)
        image = base64.b64encode(drawn(figure, "svg")).decode() if figure is not None else ""
        sections.append(f"<h2>{text}</h2>")
        if image:
            sections.append(f'<img alt="{text}" src="data:image/svg+xml;base64,{image}">')
        if table is not None:
            sections.append(_as_html(table))
    if program:
        sections.append(f"<h2>The same in Python</h2><pre>{html.escape(program)}</pre>")
    safe = html.escape(title)
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{safe}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head>'
        f"<body><h1>{safe}</h1>{''.join(sections)}</body></html>\n"
    )


def archive(files: Mapping[str, bytes]) -> bytes:
    """Put files into one zip.

    Examples
    --------
    >>> import io, zipfile
    >>> from gmwm_jax.app.web import report
    >>> zipfile.ZipFile(io.BytesIO(report.archive({"a.csv": b"1"}))).read("a.csv")
    b'1'
    """
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as written:
        for name, data in files.items():
            written.writestr(zipfile.ZipInfo(name, _WHEN), data, zipfile.ZIP_DEFLATED)
    return content.getvalue()


def drawn(figure: Figure, kind: str) -> bytes:
    """Draw a figure of Matplotlib as a file, the same bytes each time.

    Parameters
    ----------
    figure
        What to draw.
    kind
        ``svg``, ``pdf`` or ``png``.

    Examples
    --------
    >>> from gmwm_jax.app.web import report
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["gyro_x"]))
    >>> report.drawn(wv.plot(), "pdf")[:4]
    b'%PDF'
    """
    file = io.BytesIO()
    date = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    figure.savefig(file, format=kind, dpi=150, metadata=date)
    return file.getvalue()


_Shown = dict[str, tuple[Figure | None, Table | None]]


def _add_table(made: dict[str, bytes], shown: _Shown, name: str, heading: str, table: Table) -> None:
    made[f"{name}.csv"] = to_csv(table).encode()
    shown[heading] = (None, table)


def _add_figure(made: dict[str, bytes], shown: _Shown, name: str, heading: str, figure: Figure) -> None:
    made |= {f"{name}.{kind}": drawn(figure, kind) for kind in FORMATS}
    shown[heading] = (figure, None)


def _stem(number: int, fit: Fit) -> str:
    """Of the names of the files of a channel; its own name may be anything."""
    plain = "".join(c for c in plain_name(fit.wv.channels[0]) if c.isascii() and (c.isalnum() or c == "_"))
    return f"{number + 1}_{plain[:40]}".rstrip("_")


def _as_html(table: Table) -> str:
    def head(cells: Sequence[str]) -> str:
        return f"<tr>{''.join(f'<th>{html.escape(c)}</th>' for c in cells)}</tr>"

    units = head(table.units) if any(table.units) else ""
    rows = "".join(f"<tr>{''.join(_cell(c) for c in row)}</tr>" for row in table.rows)
    text = html.escape(table.text).replace("\n", "<br>")
    return f"<table><thead>{head(table.columns)}{units}</thead><tbody>{rows}</tbody></table><p>{text}</p>"


def _cell(value: tables.Cell) -> str:
    if isinstance(value, str):
        return f"<td>{html.escape(value)}</td>"
    text = "-" if isinstance(value, float) and not math.isfinite(value) else f"{value:.7g}"
    return f'<td class="number">{text}</td>'
