"""Tables of the page hold the numbers of the results, and their files are read back the same."""

import csv
import io
from dataclasses import replace

import numpy as np
from programs import fitted, simulated

from gmwm_jax.app.web import tables


def test_scales_are_those_of_the_wavelet_variance():
    wv = simulated()
    table = tables.scales(wv)
    rows = np.array([row[1:] for row in table.rows])
    columns = np.column_stack([wv.scales, wv.times, wv.variance, wv.shown.low, wv.shown.high, wv.shown.dof])
    np.testing.assert_array_equal(rows, columns)
    assert table.units[1:4] == ("samples", "s", "1")


def test_the_three_tables_of_a_fit_are_its_own():
    fit = replace(fitted(), wv=replace(simulated(), units=("rad/s",)))
    for table, own in (
        (tables.estimates(fit), fit.parameters()),
        (tables.filter(fit), fit.continuous()),
        (tables.datasheet(fit), fit.datasheet()),
    ):
        assert [row[2] for row in table.rows] == [e.value for e in own]
        assert [row[5] for row in table.rows] == [e.unit for e in own]


def test_a_file_is_read_back_the_same():
    table = tables.scales(simulated())
    names, units, *rows = csv.reader(io.StringIO(tables.to_csv(table), newline=""))
    assert tuple(names) == table.columns
    assert tuple(units) == table.units
    assert [tuple(map(float, row[1:])) for row in rows] == [row[1:] for row in table.rows]


def test_texts_are_no_formulas_and_numbers_stay_numbers():
    hostile = ["=cmd()", "+1", "-1", "@sum", "\tx", "\rx", ' =a,"b"', "plain"]
    table = tables.Table(("name", "value"), ("", ""), tuple((h, -1.0) for h in hostile), "")
    _, _, *rows = csv.reader(io.StringIO(tables.to_csv(table), newline=""))
    assert [row[0] for row in rows] == [*(f"'{h}" for h in hostile[:-1]), "plain"]
    assert {row[1] for row in rows} == {"-1.0"}
