"""A run cut at its events, against what must be true of any cut."""

import numpy as np
import pytest
from nav import setups

import nav_jax as nj
from nav_jax.filter.schedule import make_schedule


def assert_right(epochs, events, every):
    s = make_schedule(epochs, events, every)
    M, G = s.pattern.shape
    n, step = s.dt.shape[1], epochs[1] - epochs[0]
    assert n == every
    assert s.num_pieces == G * n
    dt, ends = (a[s.pattern].reshape(M, -1) for a in (s.dt, s.ends))
    # the time of a segment is the sum of all pieces until its end, and that of an event is its own
    np.testing.assert_allclose(epochs[0] + np.cumsum(dt.sum(axis=1)), s.time, rtol=0, atol=1e-6 * step)
    np.testing.assert_allclose(s.time[s.event], events, rtol=0, atol=2e-6 * step)
    # a piece is nothing or lies within one sample; what has no length ends none
    assert dt.min() >= 0
    assert dt.max() <= step * (1 + 1e-9)
    assert not ends[dt == 0].any()
    # by hand: time goes on piece by piece, and each uses the sample that it lies in
    samples, t = s.samples.reshape(M, -1), epochs[0]
    for m in range(M):
        for piece, end, sample in zip(dt[m], ends[m], samples[m], strict=True):
            if piece:
                assert sample == np.floor((t - epochs[0]) / step + 1e-5)
                t += piece
                assert end == (abs((t - epochs[0]) / step - np.rint((t - epochs[0]) / step)) < 1e-5)
    # all that lies between is used once
    np.testing.assert_allclose(dt.sum(), max(events) - epochs[0], rtol=0, atol=1e-5 * step)
    return s


@pytest.mark.parametrize("every", [1, 3, 10])
@pytest.mark.parametrize("seed", range(6))
def test_any_events(seed, every):
    rng = np.random.default_rng(seed)
    epochs = rng.uniform(-5, 5) + np.arange(rng.integers(20, 300) + 1) / 100.0
    span = epochs[-1] - epochs[0]
    events = epochs[0] + np.sort(rng.uniform(0, span, rng.integers(1, 15)))
    on_grid = rng.choice(epochs, 5)
    assert_right(epochs, np.concatenate([events, on_grid, events[:2]]), every)


@pytest.mark.parametrize("every", [1, 10])
def test_events_at_both_ends(every):
    epochs = np.arange(101) / 100.0
    s = assert_right(epochs, np.array([0.0, 1.0]), every)
    assert s.time[s.event[0]] == 0.0
    assert_right(epochs, np.array([1.0, 0.0, 0.5]), every)


@pytest.mark.parametrize("rate", [3.0, 7.0, 1 / 0.37])
def test_no_fix_off_the_grid_is_lost(rate):
    """R uses 1 of 31 at 3 Hz, and 1 of 56 at 7 Hz."""
    e = nj.filter.prepare(nj.Scenario(nj.motions.lemniscate(10.0, 100.0), setups.aiding(rate=rate)), rate=100.0)
    count = int(10 * rate + 1e-6)
    np.testing.assert_array_equal(np.asarray(e.timeline.valid).sum(axis=0), count)
    times = np.cumsum(np.asarray(e.timeline.dt)[np.asarray(e.timeline.pattern)].sum(axis=(1, 2)))
    for fixes in e.fixes:
        np.testing.assert_allclose(times[np.asarray(fixes[1])], np.arange(1, count + 1) / rate, rtol=0, atol=1e-8)


@pytest.mark.parametrize("event", [-0.1, 1.02])
def test_an_event_outside_is_refused(event):
    with pytest.raises(ValueError, match="outside the run from 0 to 1 s"):
        make_schedule(np.arange(101) / 100.0, np.array([0.5, event]))


def test_what_is_nearly_an_epoch_is_one():
    epochs = np.arange(101) / 100.0
    s = make_schedule(epochs, np.array([0.1 + 1e-10, 0.2, 0.3 - 1e-10]))
    assert (s.dt[s.pattern] > 0).sum() == 30
