"""The notebook for those who come from other programs: every expression of ours in its tables is one that it runs."""

import ast
import json
import re
from pathlib import Path

import pytest

PATH = Path(__file__).resolve().parents[2] / "notebooks" / "06_coming_from_other_programs.ipynb"


def shown(markdown):
    """The code in the column `here` of all tables of a text."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in markdown.splitlines() if line.startswith("|")]
    found, column = [], None
    for row in rows:
        if "here" in row:
            column = row.index("here")
        elif column is not None and not set(row[column]) <= set("-: "):
            found += re.findall(r"`([^`]+)`", row[column])
    return found


def parts(source):
    """Every statement and expression in a piece of code, as text without its layout."""
    return {ast.dump(node) for node in ast.walk(ast.parse(source)) if isinstance(node, ast.expr | ast.stmt)}


def whole(source):
    """A piece of code as `parts` has it."""
    (statement,) = ast.parse(source).body
    return ast.dump(statement.value if isinstance(statement, ast.Expr) else statement)


def test_what_is_shown_is_run():
    cells = json.loads(PATH.read_text())["cells"]
    run = set().union(*(parts("".join(c["source"])) for c in cells if c["cell_type"] == "code"))
    tables = [code for c in cells if c["cell_type"] == "markdown" for code in shown("".join(c["source"]))]
    assert len(tables) > 40
    missing = [code for code in tables if whole(code) not in run]
    assert not missing, missing


def test_cells_have_no_branch_that_may_not_run():
    cells = [c for c in json.loads(PATH.read_text())["cells"] if c["cell_type"] == "code"]
    nodes = [node for c in cells for node in ast.walk(ast.parse("".join(c["source"])))]
    assert not [n for n in nodes if isinstance(n, ast.If | ast.IfExp | ast.Try | ast.FunctionDef | ast.Lambda)]


@pytest.mark.parametrize(("code", "is_there"), [("f(1)", True), ("f( 1 )", True), ("x = 2", True), ("f(2)", False)])
def test_the_comparison_sees_code_and_not_layout(code, is_there):
    assert (whole(code) in parts("x = 2\ny = [f(\n 1)]")) is is_there
