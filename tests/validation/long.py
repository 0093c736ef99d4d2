"""What `make validate` leaves out unless ALL is 1: each kind of statistic has its cheapest cases in the short share.

A row has a test, and the cases of it that are run always; the others take minutes. A test without cases that is here
repeats at length what the rooms test on small data.
"""

NEVER: tuple[str, ...] = ()

SHORT_SHARE: dict[str, tuple[str, ...]] = {
    "test_notebooks.py::test_it_runs": (
        "01_calibrate_an_imu",
        "02_does_the_noise_model_matter",
        "03_which_model_and_how_sure",
        "05_gradients_through_navigation",
        "06_coming_from_other_programs",
        "08_a_real_drive",
    ),
    "gmwm/test_bootstraps_in_parts.py::test_a_cluster_whose_workers_are_gone": NEVER,
    "gmwm/test_bootstraps_in_parts.py::test_kill_9_of_all_at_random_moments": NEVER,
    "gmwm/test_fit.py::test_the_mtig_model_at_a_million_samples": NEVER,
    "gmwm/test_gradients.py::test_derivatives_are_those_of_refits": ("WN", "AR1", "GM", "WN + GM", "MAT32", "SIN"),
    "gmwm/test_interval_coverage.py::test_intervals_of_theory_cover": (
        "WN + RW, interior",
        "WN + RW, RW zero",
        "WN + DR, DR near zero",
        "QN + WN + RW, two near zero",
    ),
    "gmwm/test_interval_coverage.py::test_percentiles_cover": ("WN + RW, RW near zero",),
    "gmwm/test_interval_coverage.py::test_simulated_records_are_covered_too": NEVER,
    "gmwm/test_misfit.py::test_right_models_are_seldom_warned_of": (
        "WN(sigma2=1.0)-default",
        "WN(sigma2=1.0)-two-step",
        "WN(sigma2=1.0) + RW(gamma2=1e-6)-default",
        "RW(gamma2=1.0)-two-step",
    ),
    "gmwm/test_posterior.py::test_intervals_beside_bounds_cover": NEVER,
    "gmwm/test_saved.py::test_a_kill_at_any_moment": (".json-12",),
    "gmwm/test_wv_covariance_throughout.py::test_gradient_forward_reverse_and_numerical": ("AR1", "GM", "BI"),
    "nav/test_aiding_sensors.py::test_a_walking_scale_is_followed": NEVER,
    "nav/test_aiding_sensors.py::test_the_scale_is_estimated": NEVER,
    "nav/test_all_calibrated.py::test_a_filter_of_all_states_says_what_is_true": NEVER,
    "nav/test_all_calibrated.py::test_covariances_without_a_random_number_are_those_of_the_runs": NEVER,
    "nav/test_any_study.py::test_every_door": ("2",),
    "nav/test_autodiff.py::test_derivatives_are_those_of_differences": ("reference",),
    "nav/test_calibration_sources.py::test_all_together_each_run_with_its_own_gains": NEVER,
    "nav/test_calibration_sources.py::test_covariances_are_those_of_the_runs": ("scale factor", "gravity"),
    "nav/test_calibration_sources.py::test_reverse_and_forward_mode_are_differences": NEVER,
    "nav/test_calibration_sources.py::test_sensitivities_smoother_and_design_have_them": NEVER,
    "nav/test_campaigns.py::test_a_process_that_ends_after_any_file_operation": ("50",),
    "nav/test_campaigns.py::test_engines_and_their_workers_change_no_bit_and_no_stop": (
        "late threads-8",
        "processes-2",
        "Dask-2",
    ),
    "nav/test_campaigns.py::test_every_file": ("flipped",),
    "nav/test_campaigns.py::test_kill_9_of_all_at_random_moments": ("0-4",),
    "nav/test_campaigns.py::test_kill_9_of_a_worker": NEVER,
    "nav/test_campaigns.py::test_kill_9_of_workers_clients_and_schedulers_of_dask": NEVER,
    "nav/test_campaigns.py::test_memory_does_not_grow_with_the_runs": NEVER,
    "nav/test_datasheets.py::test_increments_in_steps_through_a_monte_carlo": NEVER,
    "nav/test_design.py::test_a_design_is_confirmed_on_fresh_noise": NEVER,
    "nav/test_design_of_other_truths.py::test_a_design_for_a_random_walk": NEVER,
    "nav/test_design_of_other_truths.py::test_a_truth_of_higher_order_has_no_part_in_the_family": NEVER,
    "nav/test_headings.py::test_covariances_are_those_of_the_runs_and_filters_consistent": (
        "dual_antenna-estimate",
        "magnetometer-estimate",
    ),
    "nav/test_levels.py::test_it_is_unbiased_with_few_runs_of_own_gains": NEVER,
    "nav/test_motion_noise.py::test_factors_of_a_record_that_vibrates_are_covered": NEVER,
    "nav/test_receivers.py::test_a_filter_may_lack_what_is_there_or_suspect_what_is_not": NEVER,
    "nav/test_receivers.py::test_derivatives_by_every_parameter": NEVER,
    "nav/test_receivers.py::test_runs_have_the_covariance_that_is_computed": ("lever arm", "all of a receiver"),
    "nav/test_sensors_on_arms.py::test_a_design_with_them": NEVER,
    "nav/test_smoother.py::test_it_is_consistent_and_better": ("estimate",),
    "nav/test_standstill.py::test_covariances_are_those_of_the_runs_and_filters_consistent": (
        "zero_velocity-estimate",
        "zero_rate-estimate",
    ),
    "nav/test_wheels.py::test_covariances_are_those_of_the_runs_and_filters_consistent": (
        "axle-reference-flat",
        "axle-estimate-round",
    ),
}


def left_out(nodeids: list[str]) -> set[str]:
    """Those of the tests that are left out.

    Raises
    ------
    LookupError
        A row has a test or a case that is none of its file.
    """
    found, out = set(), set()
    for nodeid in nodeids:
        where, _, case = nodeid.partition("[")
        test, case = where.rpartition("validation/")[2], case.removesuffix("]")
        if test in SHORT_SHARE:
            found |= {(test, case), (test, None)}
            if case not in SHORT_SHARE[test]:
                out.add(nodeid)
    files = {nodeid.rpartition("validation/")[2].partition("::")[0] for nodeid in nodeids}
    rows = {(test, case) for test, cases in SHORT_SHARE.items() for case in (None, *cases)}
    unknown = {row for row in rows - found if row[0].partition("::")[0] in files}
    if unknown:
        raise LookupError(f"No such test or case, see {__file__}: {sorted(unknown, key=str)}")
    return out
