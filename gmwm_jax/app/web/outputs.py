"""What rooms show: figures, texts and the state of a computation."""

import math
from typing import Any

import plotly.graph_objects as go
from htmltools import Tag
from shiny import ui
from shiny.render.renderer import Jsonifiable, Renderer

from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.tables import Table


def output_figure(id: str) -> Tag:
    """Make the place of a figure, and of what is said while it is computed."""
    return ui.div(
        ui.div(class_="gmwm-state", role="status"), ui.div(id=id, class_="gmwm-figure"), class_="gmwm-figure-frame"
    )


class render_figure(Renderer[go.Figure | Outcome[Any] | None]):
    """Renders a function that returns a figure, or the outcome that there is no figure of yet."""

    def auto_output_ui(self) -> Tag:
        """Make its place."""
        return output_figure(self.output_id)

    async def transform(self, value: go.Figure | Outcome[Any]) -> Jsonifiable:
        """Make what the page's script draws."""
        if isinstance(value, Outcome):
            return {"busy": value.busy} if value.busy else None
        return {"figure": value.to_json(), "name": self.output_id}


def status(outcome: Outcome[Any]) -> Tag | None:
    """Show why there is no value, for everybody who listens."""
    if outcome.error:
        return ui.div(outcome.error, class_="gmwm-error", role="alert")
    return ui.div(outcome.busy, role="status") if outcome.busy else None


def text(value: Any) -> Tag | None:
    """Show a result as it prints."""
    return None if value is None else ui.tags.pre(str(value), class_="gmwm-text", tabindex="0")


def as_html(table: Table) -> Tag:
    """Show a table; units stand in the heads of columns."""

    def head(name: str, unit: str) -> Tag:
        return ui.tags.th(f"{name} [{unit}]" if unit else name, scope="col")

    def cell(value: Any) -> Tag:
        if isinstance(value, float):
            return ui.tags.td(f"{value:.5g}" if math.isfinite(value) else "-")
        return ui.tags.td(str(value))

    heads = ui.tags.tr(*(head(*pair) for pair in zip(table.columns, table.units, strict=True)))
    rows = [ui.tags.tr(*map(cell, row)) for row in table.rows]
    made = ui.tags.table(
        ui.tags.caption(table.text, style="caption-side: top; white-space: pre-line"),
        ui.tags.thead(heads), ui.tags.tbody(*rows), class_="table",
    )  # fmt: skip
    return ui.div(made, class_="gmwm-table", tabindex="0")
