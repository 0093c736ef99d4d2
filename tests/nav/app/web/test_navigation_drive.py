"""A recorded drive on the page: what the command gives; nothing of the server is named, read or written."""

from functools import partial

import numpy as np
import pytest
from nav.small_drive import write_drive

from gmwm_jax.app.web.limits import Limits
from nav_jax.app.web import figures
from nav_jax.app.web.drive import Filtering, Sent, check, navigate, study_outages
from nav_jax.recorded.study import OutageStudy


@pytest.fixture
def sent(tmp_path):
    return [Sent(path.name, str(path.rename(tmp_path / f"{i}"))) for i, path in enumerate(write_drive(tmp_path))]


@pytest.mark.slow
def test_a_drive_is_navigated_and_drawn(sent):
    told = []
    found = navigate(sent, Limits(), lambda done, total: told.append(done))
    assert told
    assert np.abs(found.solution.trajectory.position).max() < 0.1
    assert found.text.startswith("white: ")
    assert {"fix", "navigation"} <= {trace.name for trace in figures.drive(found.solution).data}


@pytest.mark.slow
def test_outages_of_a_drive_are_studied_and_drawn(sent):
    """Fixes are of 1 to 4 s: of the first run, outages at 2 and 3 s; of the other one half a second later."""
    told = []
    found = study_outages(sent, Limits(), lambda done, total: told.append(done), last=0.5, every=1.0)
    assert told
    np.testing.assert_allclose(found.study.start, [2.0, 3.0, 2.5, 3.5])
    np.testing.assert_allclose(found.study.end - found.study.start, 0.5)
    assert found.text == f"white: {found.study!r}"
    drawn = {trace.name: trace for trace in figures.outages(found.study).data}
    order = np.argsort(found.study.start)
    np.testing.assert_array_equal(drawn["predicted - measured"].y, found.study.size[order])
    np.testing.assert_array_equal(drawn["claimed (rms)"].y, found.study.claimed[order])
    assert drawn["predicted - measured"].text == ("2", "2.5", "3", "3.5")


@pytest.mark.slow
def test_a_filter_is_chosen_and_takes_notice(tmp_path):
    """Of two filters, with a fix that is 100 m off: the gate refuses it, and with it alone the drive stays in place."""
    paths = write_drive(tmp_path)
    other = '[filters.other]\naccel = "WN(sigma2=1e-4)"\ngyro = "WN(sigma2=1e-6)"\nrate = "20 Hz"\n'
    paths[2].write_text(paths[2].read_text() + other)
    fixes = paths[1].read_text().splitlines()
    paths[1].write_text("\n".join([*fixes[:3], "3.0,100.0,0.0,0.0", *fixes[4:]]))
    sent = [Sent(path.name, str(path)) for path in paths]
    with pytest.raises(ValueError, match=r"'nobody'.*white, other"):
        navigate(sent, Limits(), lambda done, total: None, filtering=Filtering("nobody"))
    farthest = {}
    for gate in (None, 0.999):
        filtering = Filtering("other", gate, 0.1)
        found = navigate(sent, Limits(), lambda done, total: None, filtering=filtering)
        assert found.text.startswith("other: ")
        farthest[gate] = np.abs(found.solution.trajectory.position).max()
    assert farthest[0.999] < 0.5 < 10 < farthest[None]
    three = study_outages(
        sent, Limits(), lambda done, total: None, last=0.5, every=1.5, runs=3, filtering=Filtering("white", 0.999)
    )
    assert set(three.study.schedule.tolist()) == {0, 1, 2}


@pytest.mark.slow
def test_outages_that_have_no_place_are_said_without_a_path(sent, tmp_path):
    with pytest.raises(ValueError, match="there is no place for an outage of 15 s") as refused:
        study_outages(sent, Limits(), lambda done, total: None, last=15.0, every=60.0)
    assert "/" not in str(refused.value)


def test_many_outages_are_drawn_from_the_left_and_not_all_named():
    start = np.arange(60.0, 60.0 * 101, 60.0)
    error, covariance = np.ones((100, 2)), np.tile(np.eye(2), (100, 1, 1))
    study = OutageStudy("gnss", "m", np.zeros(100, int), start, start + 15, error, covariance)
    axis = figures.outages(study).layout.xaxis
    assert axis.range == (-0.5, 99.5)
    assert axis.ticktext[:2] == ("60", "360")
    assert len(axis.ticktext) == len(axis.tickvals) == 20


@pytest.mark.parametrize("work", [navigate, partial(study_outages, last=0.5, every=1.0)])
def test_a_drive_is_cancelled(sent, work):
    def cancel(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work(sent, Limits(), cancel)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('[record]\nimu = "/etc/passwd"', "'/etc/passwd', which was not sent"),
        ('[record]\nimu = "../0.csv"', "which was not sent"),
        ('[[aiding]]\nfile = "other.csv"', "'other.csv', which was not sent"),
        ('[output]\nfolder = "/tmp"', "leave it out"),
        ("[record", "is no TOML"),
    ],
)
def test_only_what_was_sent_is_read_and_nothing_written(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        check(text, ["imu.csv"])


def test_what_is_wrong_with_the_files_is_said(sent):
    with pytest.raises(ValueError, match="there are 0"):
        navigate(sent[:2], Limits(), lambda done, total: None)
    with pytest.raises(ValueError, match="is no name of a file"):
        navigate([*sent, Sent("../x.csv", "x")], Limits(), lambda done, total: None)


@pytest.mark.parametrize("name", ["imu.csv", "x" * 300, "a\0b"])
def test_names_that_no_folder_can_have_are_refused_without_a_path(sent, tmp_path, name):
    with pytest.raises(ValueError, match=r"Two files|no name of a file") as refused:
        navigate([*sent, Sent(name, str(tmp_path / "0"))], Limits(), lambda done, total: None)
    assert "/" not in str(refused.value)


def test_a_configuration_has_a_largest_size(sent):
    with open(sent[-1].path, "a") as file:
        file.write("# x\n" * 300_000)
    with pytest.raises(ValueError, match="the most of a configuration"):
        navigate(sent, Limits(), lambda done, total: None)


@pytest.mark.slow
def test_what_takes_too_long_is_not_said_to_be_memory(sent):
    with pytest.raises(ValueError, match="drive was not navigated within 0 s of a processor"):
        navigate(sent, Limits(job_seconds=0.0), lambda done, total: None)
    with pytest.raises(ValueError, match="outages were not studied within 0 s of a processor"):
        study_outages(sent, Limits(job_seconds=0.0), lambda done, total: None, last=0.5, every=1.0)
