"""What the page has to have and to refuse, row by row, each with the tests that show it."""

# ruff: noqa: E501

import re
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]

FEATURES = """
data from a library, simulated, public, own | test_units::test_the_published_example_from_its_variance_to_a_filter test_data_and_variance::test_a_link_brings_the_inputs_back_and_pages_are_apart test_data_and_variance::test_files_of_every_kind_give_the_curve_of_the_library test_page_file::test_pasted_values_are_fitted_saved_and_loaded_by_a_colleague
public recordings by name | test_data_and_variance::test_public_recordings_are_opened_by_name
library of 21 published variances | test_library::test_all_channels_are_there test_library::test_numbers_are_those_of_the_source
own file, delimiter and names found | test_data_and_variance::test_files_of_every_kind_give_the_curve_of_the_library test_io::test_text_given_header_and_delimiter
columns, channels, units, time | test_data_and_variance::test_files_of_every_kind_give_the_curve_of_the_library
rate and unit required | test_data_and_variance::test_bad_files_get_a_sentence_and_the_page_lives
missing values are an error with a name | test_data_and_variance::test_bad_files_get_a_sentence_and_the_page_lives
gaps as pairs, longest run | test_data_and_variance::test_gaps_are_an_error_pairs_or_the_longest_run
classic and robust, compared | test_data_and_variance::test_robust_beside_classic
outliers are masked | test_data_and_variance::test_outliers_are_masked_when_asked
all channels at once | test_data_and_variance::test_the_variance_is_that_of_the_library
variance in seconds with its unit, Allan, slopes | test_data_and_variance::test_the_variance_is_that_of_the_library test_figures::test_slopes_are_those_of_what_is_drawn test_figures::test_units_of_the_page_are_converted
boxes, text, held values | test_model::test_boxes_are_fitted_and_nothing_stale_is_shown test_model::test_values_can_be_given_and_held
number of GM | test_model::test_values_can_be_given_and_held
nothing ticked | test_model::test_boxes_are_fitted_and_nothing_stale_is_shown
fit: global minimum, boundaries named | test_tutorial::test_printed_numbers_stand_beside_the_minima test_figures::test_a_component_at_zero_is_named
weights | test_model::test_weights_are_chosen
fit with components, residuals, datasheet | test_figures::test_the_fit_has_its_components_and_residuals test_model::test_the_datasheet_is_drawn_and_adopted
any order of rooms | test_tutorial::test_a_step_is_done_where_its_link_leads
per sample, filter and datasheet side by side | test_units::test_the_published_example_from_its_variance_to_a_filter test_tables::test_the_three_tables_of_a_fit_are_its_own
replicates: 500, progress, cancel keeps what is done | test_inference::test_replicates_are_those_of_the_library_and_never_stale test_inference::test_what_is_cancelled_keeps_what_is_done
ranked models, adopted by a click | test_inference::test_the_recommended_model_is_adopted
datasheet as text: N B f0 K Q LSB R GM | test_datasheet::test_typed_entries_are_those_of_the_library test_figures::test_the_datasheet_is_its_wavelet_variance
units of filters with formula, both ways | test_formula::test_to_filters test_formula::test_there_and_back test_units::test_numbers_are_converted_with_the_formula
the trap of the two variances of GM | test_formula::test_the_trap_of_the_two_variances
tutorial, credits | test_tutorial::test_printed_numbers_stand_beside_the_minima
theory as MathML | test_model::test_theory_is_read_on_the_page test_theory::test_moments_are_those_of_the_library
download, link, script, cancel | test_takeaway::test_the_archive_has_everything_and_its_program_gives_the_same_numbers test_data_and_variance::test_a_link_brings_the_inputs_back_and_pages_are_apart test_inference::test_what_is_cancelled_keeps_what_is_done
nothing from outside | test_data_and_variance::test_it_starts_offline_with_names_for_everything
"""
"""Of the two older programs and beyond."""

THREATS = """
size of an upload, whatever is declared | test_guard::test_bytes_are_counted_whatever_is_declared test_data_and_variance::test_bad_files_get_a_sentence_and_the_page_lives
a socket opened by another page | test_guard::test_a_socket_opens_for_the_own_page_only
another host name | test_guard::test_other_hosts_are_not_answered
size of a message | test_guard::test_a_message_that_is_too_large_ends_its_page_alone
names of files are never paths nor tags | test_data_and_variance::test_bad_files_get_a_sentence_and_the_page_lives
paths that lead out, sessions of others | test_guard::test_no_path_leads_out
headers | test_guard::test_headers_of_every_answer
unknown errors are a number on the page | test_model::test_an_unknown_error_is_a_number
pickles and arrays of objects | test_data_and_variance::test_bad_files_get_a_sentence_and_the_page_lives
npz that unfolds | test_hostile_files::test_an_archive_of_zeros
R data that unfold | test_hostile_files::test_r_data_of_zeros
npy that lies | test_hostile_files::test_an_array_that_promises_what_is_not_there test_data_and_variance::test_bad_files_get_a_sentence_and_the_page_lives
deep R data | test_hostile_files::test_deep_r_data
wide tables, long lines | test_hostile_files::test_two_million_columns test_hostile_files::test_a_line_of_50_mb
Parquet that unfolds | test_hostile_files::test_a_parquet_file_of_zeros
filters of warnings of other threads | test_hostile_files::test_reading_r_data_leaves_the_filters_of_warnings_alone
heavy models | test_model::test_values_can_be_given_and_held
time of what is computed at a click, one of a page at a time | test_turns::test_what_takes_too_long_is_left_behind_and_others_go_on test_turns::test_a_page_that_asks_for_much_waits_for_itself
time of long work | test_jobs::test_work_that_takes_too_long_keeps_what_is_done
too many pages, idle pages | test_guard::test_one_page_too_many_gets_a_sentence_and_idle_ones_end
pages are apart | test_data_and_variance::test_a_link_brings_the_inputs_back_and_pages_are_apart test_inference::test_another_page_is_answered_meanwhile
temporary files of a server that was killed | test_guard::test_killed_during_an_upload_and_a_job_nothing_is_left_and_the_link_restores
texts in CSV are no formulas | test_tables::test_texts_are_no_formulas_and_numbers_stay_numbers
names in figures are no tags | test_figures::test_names_are_no_tags
inputs in links | test_guard::test_two_hundred_links_of_nonsense
compiled programs are their owner's | test_compiled::test_compiled_programs_are_their_owners
behind a proxy | test_guard::test_behind_a_proxy
files of the server by name alone | test_guard::test_what_is_stored_on_the_server_is_found_by_name_alone
"""
"""Of a server that others reach."""


def rows(table):
    return [[part.strip() for part in line.split("|")] for line in table.strip().splitlines()]


@pytest.mark.parametrize("table", [FEATURES, THREATS], ids=["features", "threats"])
def test_every_test_that_is_named_is_there(table):
    for row, named in rows(table):
        for name in named.split():
            file, _, test = name.partition("::")
            found = "".join(path.read_text() for path in TESTS.rglob(f"{file}.py"))
            assert re.search(rf"^def {test}\(", found, re.M), f"{row}: {name}"
