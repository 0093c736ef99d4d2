"""Curves are told apart by eyes without green receptors, and without any colour."""

import itertools

import numpy as np

from gmwm_jax._internal.palette import COLOURS, DASHES, MARKERS, nested, turns
from gmwm_jax.plotting._style import DATA, FIT, component_style

DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)
"""On linear sRGB: Machado, Oliveira, Fernandes (2009), severity 1."""

XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""Of linear sRGB (IEC 61966-2-1)."""


def lab(colour, receptors):
    """CIE 1976 L*a*b* of a colour as an eye sees it."""
    srgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    x, y, z = XYZ @ np.clip(receptors @ linear, 0, 1) / np.array([0.95047, 1.0, 1.08883])
    fx, fy, fz = (np.cbrt(t) if t > 0.008856 else 7.787 * t + 16 / 116 for t in (x, y, z))
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


def closest(colours, receptors):
    """The smallest difference of two colours; 2.3 is just seen beside each other."""
    return min(np.linalg.norm(lab(a, receptors) - lab(b, receptors)) for a, b in itertools.combinations(colours, 2))


def test_the_simulation_confuses_red_and_green():
    assert closest(["#d03020", "#7a7a10"], np.eye(3)) > 60
    assert closest(["#d03020", "#7a7a10"], DEUTERANOPIA) < 20


def test_colours_are_told_apart_without_green_receptors():
    assert closest(COLOURS, np.eye(3)) > 20
    assert closest(COLOURS, DEUTERANOPIA) > 20


def test_components_of_a_fit_differ_in_colour_and_in_dashes():
    styles = [component_style(i) for i in range(5)]
    assert closest([DATA, FIT, *(s["color"] for s in styles)], DEUTERANOPIA) > 20
    assert len({s["ls"] for s in styles}) == 5
    # where colours begin again dashes go on
    both = [(s["color"], s["ls"]) for s in map(component_style, range(30))]
    assert len(set(both)) == 30
    assert len(set(DASHES)) == len(DASHES)
    assert len(set(MARKERS)) == len(MARKERS)


def test_curves_that_coincide_share_the_way():
    """At each place of the way one of them is on top, and each somewhere."""
    for num in (2, 3, 4):
        on_top = np.zeros(int(num * 30), int)
        for i in range(1, num):
            offset, (on, off) = turns(i, num)["ls"]
            way = (np.arange(len(on_top)) / 10 + offset) % (on + off) < on
            on_top[way] = i
        assert set(on_top) == set(range(num))
        np.testing.assert_allclose(np.bincount(on_top), 30, atol=1)


def test_nested_curves_become_thinner():
    for num in (1, 3, 8):
        widths = [nested(i, num)["lw"] for i in range(num)]
        assert widths == sorted(widths, reverse=True)
        assert len(set(widths)) == num
        assert max(widths) < 6
