"""Which tests `make test` leaves to `.ci/run` (`make thorough`), and why: what takes long, or another program.

Everything else runs in both. A row that names nothing fails test_tiers.py.
"""

from __future__ import annotations

import pytest

COLLECTED = pytest.StashKey[list[str]]()
"""Names of all tests that a run has found, those too that it then leaves out."""

THOROUGH = {
    "test/book/test_blocks.py": "runs README and tutorials as they stand",
    "test/browser": "drives Chromium",
    "test/mutation": "damages 40 files of every format",
    "test/sdimu_calibration/core/diagnosis/test_unknown_attitude.py": "diagnoses of several rounds",
    "test/recovery/test_faults.py": "every fault of the data at every size",
    "test/recovery/test_grades.py": "every IMU file, from samples to result",
    "test/sdimu_calibration/api/test_typed.py": "runs mypy over the package",
    "test/test_wheels.py": "builds and unpacks the wheels",
    "test/sdimu_calibration/cli/test_terminal.py": "every verb in a window of another size",
    "test/sdimu_calibration/report/workbench/test_speed.py": "times the workbench",
    "test/sdimu_study": "small versions of the campaigns",
}
"""Files and folders, with the reason."""

LONG = {
    "test/sdimu_calibration/core/diagnosis/test_strong_flicker.py": (
        "test_an_effect_is_found_where_noise_that_follows_the_rate_took_it_up",
        "test_no_physics_is_named_for_what_moves_within_stretches",
    ),
    "test/sdimu_calibration/core/joint/test_changed.py": (
        "test_scale_factors_of_the_accelerometers_that_differ_alike_are_those_of_another_site",
        "test_a_coefficient_that_changed_is_told_as_such_and_not_as_physics_that_looks_like_it[gyro_misalignment_xy-2e-05]",
        "test_of_two_recordings_the_difference_is_told_and_not_which_of_them_changed",
        "test_an_effect_of_one_recording_is_told_of_none_of_the_others",
    ),
    "test/sdimu_calibration/core/joint/test_function_fit.py": (
        "test_it_changes_next_to_nothing_where_nothing_is_left",
        "test_a_diagnosis_tells_nothing_that_imitates_it_where_two_plans_share_few_attitudes",
        "test_coefficients_are_as_good_as_their_sigmas_say",
        "test_recordings_with_functions_of_their_own_share_none",
    ),
    "test/sdimu_calibration/core/joint/test_static_sets.py": (
        "test_six_rests_of_a_cube_are_a_set",
        "test_static_recordings_are_diagnosed",
        "test_up_and_down_are_a_set_whatever_their_order_and_names[mems_consumer-1]",
        "test_recordings_of_which_none_knows_an_azimuth_are_a_set[1]",
        "test_noise_that_moves_within_the_only_rest_of_a_recording_is_no_warm_up[mems_industrial-210005-turns0-noise0]",
    ),
    "test/sdimu_calibration/core/posterior/test_detectable.py": (
        "test_the_search_tells_about_four_in_five_effects_of_the_stated_size",
    ),
    "test/sdimu_calibration/core/posterior/test_near.py": (
        "test_a_diagnosis_tells_what_it_tells_with_all_of_them",
        "test_what_is_kept_is_what_a_move_brings_near_the_best_model",
    ),
    "test/sdimu_calibration/core/posterior/test_prior.py": (
        "test_a_certain_effect_that_is_added_changes_no_probability_of_the_others",
    ),
    "test/sdimu_calibration/core/posterior/test_models.py": (
        "test_probabilities_come_true_where_the_world_is_as_the_prior_says",
    ),
    "test/sdimu_calibration/report/workbench/test_guard.py": ("test_a_bad_state_shows_a_page_and_says_what_is_wrong",),
    "test/ros/test_live_diagnosis.py": (
        "test_all_data_are_ranked_as_the_first_scan_of_a_diagnosis_of_the_bag",
        "test_of_the_requests_that_wait_the_newest_alone_is_answered",
        "test_a_test_that_has_ended_leaves_diagnosis_and_report_where_they_are_wanted",
        "test_a_worker_killed_in_mid_search_is_started_anew_and_answers_the_same",
        "test_a_worker_killed_while_it_draws_answers_once",
        "test_shell_notebook_workbench_and_the_live_end_tell_the_same_probabilities",
    ),
    "test/sdimu_calibration/api/test_api.py": (
        "test_a_coefficient_knows_its_units",
        "test_a_handheld_fit_takes_no_assumed_site",
        "test_words_for_estimators_and_models_are_those_of_the_shell",
    ),
    "test/sdimu_calibration/api/test_recording_set.py": (
        "test_what_cannot_be_used_is_one_line",
        "test_files_are_those_of_the_verbs",
        "test_a_diagnosis_of_a_set_says_what_is_known_and_what_to_record",
        "test_a_joint_fit_is_a_table_with_units",
    ),
    "test/sdimu_calibration/cli/test_diagnose.py": (
        "test_a_coefficient_that_is_another_one_is_told_by_a_diagnosis",
        "test_a_run_by_hand_is_diagnosed_by_its_own_fit",
    ),
    "test/sdimu_calibration/cli/test_exit_status.py": (
        "test_diagnose_ends_as_its_verdict_says[2]",
        "test_a_search_that_does_not_settle_ends_with_3[2]",
    ),
    "test/sdimu_calibration/cli/test_noise.py": ("test_pulses_and_wandering_bias_go_into_the_file",),
    "test/sdimu_calibration/cli/test_plan.py": ("test_what_only_a_change_of_temperature_tells_is_said_so",),
    "test/sdimu_calibration/core/batch/test_batch.py": (
        "test_batch_and_filter_agree_in_covariance_and_in_estimate",
        "test_misfit_of_the_batch_is_that_of_the_noise",
        "test_the_filter_is_honest_at_the_poles[-90.0]",
        "test_coefficients_are_honest_near_and_at_the_poles[-80.0]",
        "test_coefficients_are_honest_near_and_at_the_poles[-90.0]",
        "test_coefficients_are_honest_near_and_at_the_poles[80.0]",
        "test_coefficients_are_honest_near_and_at_the_poles[90.0]",
        "test_errors_of_percents_are_found_with_honest_sigmas",
        "test_errors_of_the_batch_are_as_large_as_it_says",
        "test_a_wrong_azimuth_at_the_start_changes_nothing_at_the_end",
    ),
    "test/sdimu_calibration/core/data/test_latitude_check.py": (
        "test_the_right_place_is_never_contradicted",
        "test_the_vertical_rate_of_the_earth_is_right_within_its_sigma",
    ),
    "test/sdimu_calibration/core/data/test_vibration.py": (
        "test_a_table_that_vibrates_is_calibrated_with_honest_sigmas[17.0]",
    ),
    "test/sdimu_calibration/core/diagnosis/test_diagnose.py": (
        "test_a_diagnosis_is_gone_when_nobody_holds_it",
        "test_a_bias_that_settles_after_each_turn_is_named_and_its_time_constant_found",
        "test_a_drift_that_takes_many_steps_is_called_a_wander",
        "test_a_sine_of_any_phase_and_period_is_one_equation",
        "test_a_wrong_density_ends_as_a_wrong_noise_model_and_is_measured",
        "test_a_wrong_latitude_is_measured_and_sent_back_to_the_site_file",
        "test_the_search_stays_quiet_on_noise",
        "test_turns_of_one_sign_hide_scale_asymmetry_and_the_reason_is_said",
        "test_an_effect_far_beyond_its_class_is_measured_at_its_size_without_companions",
        "test_noise_with_a_memory_is_told_with_its_size",
        "test_outliers_are_told_as_wrong_samples_and_end_as_no_effect",
        "test_the_ladder_of_refits_says_how_far_the_error_falls_and_refuses_what_does_not_lower_it",
        "test_what_only_the_nis_shows_is_not_called_explained",
        "test_clean_data_give_scores_of_unit_size_and_no_find",
    ),
    "test/sdimu_calibration/core/diagnosis/test_effects_in_noise.py": (
        "test_a_calibration_in_coloured_noise_has_the_sigma_that_its_errors_have",
        "test_the_mean_bias_does_not_hang_on_which_drift_it_is",
        "test_an_effect_in_flicker_noise_is_named_and_the_noise_is_not",
    ),
    "test/sdimu_calibration/core/diagnosis/test_families.py": (
        "test_a_delay_of_a_gyro_and_its_sensitivity_to_angular_acceleration_are_one_find",
        "test_a_triad_that_turns_is_told_as_one_effect_on_two_axes",
        "test_an_effect_that_is_not_to_be_tried_is_not_named_and_something_is_missing_all_the_same",
    ),
    "test/sdimu_calibration/core/diagnosis/test_handheld_diagnosis.py": (
        "test_an_effect_that_nothing_bounds_and_nothing_shows_has_no_signature",
        "test_a_right_model_is_left_alone",
        "test_a_turn_shows_what_acts_only_in_turns",
        "test_two_that_stood_for_one_in_the_scatter_give_way_to_it",
        "test_a_swing_in_time_is_told_with_its_period",
    ),
    "test/sdimu_calibration/core/diagnosis/test_late_accelerometers.py": (),
    "test/sdimu_calibration/core/diagnosis/test_pairs.py": (
        "test_noise_makes_no_pairs",
        "test_two_effects_that_hide_each_other_are_both_named",
    ),
    "test/sdimu_calibration/core/diagnosis/test_strong_effects.py": (
        "test_a_weaker_effect_beside_strong_ones_is_named_and_nothing_without_a_cause",
    ),
    "test/sdimu_calibration/core/estimation/test_every_estimator.py": (
        "test_free_navigation_is_made_or_refused_with_its_reason[mems_industrial batch]",
        "test_a_fit_is_diagnosed_and_shown[mems_by_hand handheld]",
        "test_a_fit_answers_every_question[mems_industrial filter]",
        "test_a_fit_answers_every_question[mems_industrial batch]",
        "test_a_result_is_written_read_compensated_and_exported[mems_industrial batch]",
        "test_a_result_is_written_read_compensated_and_exported[mems_industrial filter]",
        "test_every_caller_gives_the_same_digits[fog_tactical]",
        "test_every_caller_gives_the_same_digits[mems_consumer]",
        "test_every_caller_gives_the_same_digits[mems_industrial]",
        "test_every_caller_gives_the_same_digits[rlg_navigation]",
        "test_a_fit_is_diagnosed_and_shown[mems_industrial batch]",
    ),
    "test/sdimu_calibration/core/estimation/test_free_azimuth.py": (
        "test_an_azimuth_that_the_site_states_counts_where_it_is_known_well_enough[60.0-True]",
        "test_a_fit_that_loses_the_azimuth_gives_way_to_one_that_does_without_it",
        "test_a_navigation_without_aid_drifts_as_promised_in_the_noise_that_was_learned",
        "test_a_set_takes_each_recording_without_its_azimuth",
    ),
    "test/sdimu_calibration/core/estimation/test_reference_temperature.py": (
        "test_another_reference_moves_the_biases_by_the_coefficient_and_no_prediction[mems_industrial-table_test-filter]",
    ),
    "test/sdimu_calibration/core/estimation/test_uncertain_site.py": (
        "test_a_hidden_effect_is_named_beside_a_site_that_is_off",
        "test_a_run_by_hand_takes_the_gravity_of_its_site_with_its_sigma",
    ),
    "test/sdimu_calibration/core/posterior/test_likely_noise.py": (
        "test_the_size_of_a_term_is_inside_its_interval[flicker-3.0-10]",
        "test_the_size_of_a_term_is_inside_its_interval[markov-3.0-10]",
        "test_the_size_of_a_term_is_inside_its_interval[random_walk-0.2-10]",
        "test_the_size_of_a_term_is_inside_its_interval[shift-3.0-10]",
        "test_the_size_of_a_term_is_inside_its_interval[stop-3.0-10]",
        "test_the_size_of_a_term_is_inside_its_interval[turn-3.0-10]",
        "test_white_noise_is_likeliest_where_there_is_no_other",
    ),
    "test/sdimu_calibration/core/fleet/test_datasheet.py": (
        "test_repeatability_is_in_its_interval_as_often_as_stated[8]",
        "test_the_largest_size_is_in_its_interval_as_often_as_stated[8]",
    ),
    "test/sdimu_calibration/core/joint/test_combine.py": (
        "test_errors_are_as_large_as_their_sigmas[3]",
        "test_errors_are_as_large_as_their_sigmas[8]",
        "test_intervals_of_the_scatter_hold_it",
    ),
    "test/sdimu_calibration/core/joint/test_held_out.py": (
        "test_two_recordings_that_lack_an_effect_show_it_in_the_noise_of_those_that_have_it",
        "test_what_chance_reaches_is_known_for_two_recordings",
    ),
    "test/sdimu_calibration/core/diagnosis/test_parts.py": (
        "test_a_fourth_power_is_told_as_that_and_not_as_a_square_and_an_asymmetry",
        "test_a_square_beside_an_asymmetry_stays_both",
    ),
    "test/sdimu_calibration/core/joint/test_near_equations.py": (
        "test_a_set_tells_an_equation_in_the_place_of_wrong_effects",
    ),
    "test/sdimu_calibration/core/joint/test_set_ladder.py": (
        "test_each_model_has_its_error_and_its_metres",
        "test_page_file_and_words_tell_the_same_metres",
    ),
    "test/sdimu_calibration/core/joint/test_recurrence.py": (
        "test_recordings_in_the_same_order_do_not_tell_attitude_from_time",
    ),
    "test/sdimu_calibration/core/handheld/test_handheld.py": (
        "test_an_extra_force_at_rest_is_learned_and_widens_the_sigmas",
        "test_without_noise_the_squares_of_the_errors_come_out_too",
    ),
    "test/sdimu_calibration/core/plan_search/test_plan_search.py": (
        "test_asymmetry_and_quadratic_term_are_told_apart_by_another_rate_about_their_axis",
        "test_in_a_given_time_the_worst_sigma_gets_smaller",
    ),
    "test/sdimu_calibration/core/posterior/test_unknown.py": (
        "test_an_error_of_one_sensor_is_told_of_that_sensor_alone",
        "test_an_error_in_turns_that_is_a_function_of_the_rate_is_told_and_drawn_against_the_rate",
        "test_it_is_told_as_noise_that_follows_the_attitude_and_not_as_effects",
        "test_the_function_that_is_drawn_is_the_hidden_one_within_its_band",
        "test_errors_of_two_sensors_are_told_of_these_two",
    ),
    "test/sdimu_calibration/storage/test_hostile_files.py": (
        "test_a_mat_file_gets_the_memory_that_it_may",
        "test_an_npz_unpacks_to_what_it_may",
    ),
    "test/sdimu_calibration/core/joint/test_set_fit.py": (
        "test_what_a_strong_effect_leaves_at_an_earlier_point_is_no_noise_beside_it",
        "test_what_noise_of_a_recording_takes_in_is_judged_as_in_a_recording_by_itself",
        "test_more_recordings_know_more",
        "test_a_recording_has_its_own_value_of_an_effect_that_all_have",
        "test_a_coefficient_that_changed_in_one_recording_is_pointed_out",
        "test_a_coefficient_that_follows_the_date_is_told",
        "test_recordings_that_say_no_time_keep_their_order_in_tables_alone",
        "test_a_clean_set_scatters_as_chance_does",
        "test_errors_of_a_set_are_those_its_sigmas_say",
        "test_recordings_that_the_model_does_not_fit_are_named_though_learned_noise_takes_it_in",
        "test_the_result_depends_on_neither_order_nor_names",
    ),
    "test/sdimu_calibration/core/joint/test_set_search.py": (
        "test_a_clean_set_is_consistent",
        "test_a_fault_of_one_recording_is_told_of_that_one",
        "test_what_all_have_and_one_has_more_of_is_told_as_both",
        "test_over_the_told_model_alone_coefficients_are_those_of_its_fit",
        "test_the_told_model_has_the_sigmas_of_its_fit",
        "test_what_the_window_adds_is_the_difference_of_its_moments_to_those_of_the_told_model",
        "test_a_drift_of_one_recording_is_none_of_the_bias_of_the_unit",
        "test_a_weak_effect_is_found_in_all_recordings_together",
        "test_what_two_recordings_leave_open_the_advised_third_one_closes",
    ),
    "test/sdimu_calibration/core/posterior/test_coefficients.py": (
        "test_what_some_models_lack_is_the_part_of_its_probability_that_none_of_them_holds",
        "test_what_no_averaged_model_holds_counts_with_its_probability_beside_the_likeliest",
        "test_half_of_an_equation_that_no_physics_names_moves_no_coefficient",
        "test_several_equations_of_a_sensor_are_the_cause_together_or_none_is",
    ),
    "test/sdimu_calibration/core/noise/test_quantisation.py": (
        "test_a_ring_laser_gyro_that_counts_is_calibrated[1]",
        "test_what_a_counter_hides_is_found",
        "test_a_ring_laser_gyro_that_counts_is_calibrated[2]",
    ),
    "test/sdimu_calibration/core/planning/test_stated_noise.py": (
        "test_the_prediction_is_the_covariance_of_a_test_in_that_noise[fog_tactical]",
        "test_the_prediction_is_the_covariance_of_a_test_in_that_noise[rlg_navigation]",
    ),
    "test/sdimu_calibration/core/filter/test_percents.py": (
        "test_the_filter_agrees_with_the_batch",
        "test_gyros_that_lose_the_attitude_over_the_test_are_levelled_at_every_stop",
        "test_what_speaks_against_a_result_is_in_it",
    ),
    "test/sdimu_calibration/core/test_live_growth.py": ("test_neither_memory_nor_work_grow_with_the_test",),
    "test/sdimu_calibration/report/test_data.py": ("test_residuals_are_the_whitened_innovations_coloured_again",),
    "test/sdimu_calibration/report/test_learned_noise.py": (
        "test_the_figure_that_judges_is_in_the_noise_that_was_learned_where_any_was",
    ),
    "test/sdimu_calibration/report/test_pictures.py": (
        "test_every_picture_is_small_and_opens",
        "test_pictures_of_one_diagnosis_are_the_same_bytes",
    ),
    "test/sdimu_calibration/report/workbench/test_workbench.py": (
        "test_undo_brings_the_misfit_back",
        "test_an_effect_of_ones_own_does_what_the_registered_one_does",
        "test_the_loop_finds_adds_and_takes_home_the_hidden_effect",
        "test_a_candidate_is_shown_with_what_it_would_take_before_it_is_added",
        "test_a_coefficient_is_fixed_given_a_prior_and_freed",
        "test_a_degenerate_addition_is_objected_to_before_and_after_and_gets_no_tick",
        "test_a_prior_that_the_data_contradict_gets_no_tick_and_is_named",
        "test_held_out_stops_are_predicted_not_fitted",
        "test_points_that_are_selected_are_left_out_and_taken_in_again",
        "test_two_pages_do_not_disturb_each_other_and_a_restart_loses_nothing",
        "test_what_is_taken_home_names_what_was_left_out_and_fixed",
        "test_the_verdict_leads_with_what_is_wrong_by_the_figure_of_the_report",
    ),
    "test/sdimu_calibration/storage/test_diagnosis_file.py": ("test_the_file_has_every_name_of_the_interface",),
    "test/sdimu_calibration/storage/test_equations.py": (
        "test_every_equation_that_a_diagnosis_can_propose_is_found_by_its_label",
    ),
    "test/sdimu_calibration/storage/test_recording_set.py": (
        "test_processes_give_the_same_digits",
        "test_two_dask_workers_give_bitwise_what_this_process_gives",
    ),
    "test/sdimu_sim/core/test_generator.py": (
        "test_samples_are_the_same_to_the_last_bit_however_the_motion_is_cut[1-100.0]",
        "test_samples_are_the_same_to_the_last_bit_however_the_motion_is_cut[1-333.0]",
    ),
    "test/sdimu_sim/core/test_truth.py": ("test_draws_have_the_spread_of_the_specification",),
    "test/sdimu_calibration/core/diagnosis/test_noise_of_the_result.py": (
        "test_a_result_states_the_intervals_that_are_told",
    ),
    "test/sdimu_calibration/core/diagnosis/test_assumed.py": (
        "test_what_a_drift_that_is_told_may_be_instead_is_not_taken_for_granted",
    ),
    "test/sdimu_calibration/core/posterior/test_combinations.py": (
        "test_equal_delays_of_two_accelerometers_may_be_one_of_the_triad_beside_the_third",
        "test_by_unit_force_a_cross_term_is_a_quadratic_term_with_the_other_cross_term",
    ),
    "test/sdimu_calibration/core/filter/test_seen_about_the_cycle.py": (
        "test_the_diagnosis_names_an_effect_of_the_temperature_rate",
    ),
    "test/sdimu_calibration/core/filter/test_bend.py": (
        "test_scale_factors_have_the_half_square_of_the_angle_in_their_sigma",
        "test_a_plan_that_shows_everything_makes_no_pass_for_it",
        "test_noise_of_next_to_no_size_moves_nothing_that_the_prior_decides",
    ),
    "test/sdimu_calibration/core/posterior/test_search_again.py": (
        "test_a_size_that_gets_the_wrong_sign_leaves_the_model[False]",
        "test_a_size_that_gets_the_wrong_sign_leaves_the_model[True]",
    ),
    "test/sdimu_calibration/core/estimation/test_axes_by_temperature.py": (
        "test_a_ramp_gives_the_axes_of_every_temperature[mems_industrial-batch]",
    ),
    "test/recovery/test_recovery.py": ("test_whole_plan_recovers_the_coefficients_within_their_covariance",),
    "test/sdimu_calibration/core/joint/test_same_unit.py": ("test_a_set_says_that_its_axes_are_not_told",),
    "test/sdimu_calibration/core/diagnosis/test_traps.py": (),
    "test/sdimu_calibration/core/estimation/test_stated_priors.py": (
        "test_a_stated_prior_conditions_the_fit_of_the_other_coefficients[gyro_misalignment_yz-0.5]",
    ),
    "test/sdimu_calibration/core/data/test_resting_cycles.py": (
        "test_a_test_taken_for_a_long_one_gives_the_same_estimate",
    ),
    "test/sdimu_calibration/core/diagnosis/test_grades.py": (
        "test_the_certain_effect_is_called_certain_and_the_weak_one_is_not",
    ),
    "test/sdimu_calibration/core/fleet/test_population.py": (
        "test_a_clean_fleet_has_a_unit_out_no_more_often_than_stated",
    ),
    "test/sdimu_calibration/core/handheld/test_whole_turns.py": (
        "test_whole_turns_that_are_stated_give_the_scale_factors_of_the_gyros",
    ),
    "test/sdimu_calibration/core/diagnosis/test_averaged.py": (
        "test_an_open_ramp_names_the_bias_that_is_known_less_well_for_its_sake",
        "test_what_is_widened_by_less_than_is_seen_in_use_is_not_named",
    ),
    "test/sdimu_calibration/core/posterior/test_open_noise.py": (),
    "test/sdimu_calibration/core/posterior/test_noise_models.py": (
        "test_no_pair_of_kinds_in_a_triad_is_far_better_than_what_is_found",
    ),
    "test/sdimu_calibration/core/joint/test_shared_scatter.py": (
        "test_parts_of_a_run_have_one_scatter_nearer_than_their_own",
        "test_parts_are_one_unit_that_stays_the_same",
    ),
    "test/sdimu_calibration/core/diagnosis/test_spin_axis.py": (
        "test_it_is_found_with_its_size",
        "test_no_prior_that_nobody_stated_contradicts_the_data",
    ),
}
"""Single tests of 2.5 s and more of a processor, where others of their file hold the claims of `make test`; an empty
row is the whole file."""

VARIANTS = {
    "test/sdimu_calibration/core/batch/test_batch.py": ("test_responses_of_a_motion_are_its_derivatives[0.0]",),
    "test/sdimu_calibration/core/estimation/test_axes_by_temperature.py": (
        "test_a_ramp_gives_the_axes_of_every_temperature[mems_industrial-filter]",
    ),
    "test/sdimu_calibration/core/estimation/test_every_estimator.py": (
        "test_a_fit_is_diagnosed_and_shown[dtg batch]",
        "test_a_fit_is_diagnosed_and_shown[mems_industrial filter]",
        "test_the_estimator_does_not_hang_on_how_noise_cuts_the_rests[kim18-50001]",
    ),
    "test/sdimu_calibration/core/estimation/test_free_azimuth.py": (
        "test_the_answer_is_the_same_for_every_azimuth_that_is_assumed[90.0]",
        "test_the_answer_is_the_same_for_every_azimuth_that_is_assumed[270.0]",
        "test_white_noise_leaves_as_much_of_the_azimuth_as_the_mean_rates_do[recommended]",
    ),
    "test/sdimu_calibration/core/estimation/test_stated_priors.py": (
        "test_a_stated_prior_conditions_the_fit_of_the_other_coefficients[gyro_scale_y-0.0]",
    ),
    "test/sdimu_calibration/core/posterior/test_likely_noise.py": (
        "test_noise_far_above_white_noise_keeps_its_name[random_walk]",
    ),
    "test/sdimu_calibration/core/joint/test_changed.py": (
        "test_a_coefficient_that_changed_is_told_as_such_and_not_as_physics_that_looks_like_it[accel_scale_x-4e-05]",
    ),
    "test/sdimu_calibration/core/joint/test_recurrence.py": (
        "test_what_is_of_each_recording_does_not_come_back[scatter]",
        "test_what_is_of_each_recording_does_not_come_back[time]",
    ),
    "test/sdimu_calibration/core/joint/test_static_sets.py": (
        "test_up_and_down_are_a_set_whatever_their_order_and_names[fog_tactical-1]",
        "test_up_and_down_are_a_set_whatever_their_order_and_names[mems_by_hand-1]",
        "test_up_and_down_are_a_set_whatever_their_order_and_names[rlg_navigation-1]",
    ),
    "test/sdimu_calibration/core/filter/test_seen_about_the_cycle.py": (
        "test_the_true_model_gives_an_effect_of_the_temperature_rate_its_size[2]",
        "test_the_true_model_gives_an_effect_of_the_temperature_rate_its_size[3]",
    ),
    "test/sdimu_calibration/core/test_live_end.py": (
        "test_live_end_and_bag_open_the_same_recording[second_publisher]",
        "test_live_end_and_bag_give_the_same_coefficients[dtg-cases2]",
        "test_live_end_and_bag_give_the_same_coefficients[fog_tactical-cases1]",
        "test_live_end_and_bag_give_the_same_coefficients[rlg_navigation-cases3]",
    ),
    "test/sdimu_calibration/storage/test_matlab_objects.py": (
        "test_a_map_is_proposed_with_the_units_that_the_table_states[v7]",
        "test_a_table_beside_numbers_and_structures_is_read[v7]",
        "test_a_timetable_of_dates_keeps_its_nanoseconds_and_all_columns_of_a_matrix[v7]",
        "test_durations_and_even_times_of_rows_are_seconds[durations-v7]",
        "test_durations_and_even_times_of_rows_are_seconds[step-v7]",
    ),
    "test/recovery/test_recovery.py": ("test_recovery_does_not_need_axes_along_north_east_down[mount0]",),
}
"""Variants of a test of half a second and more of which `make test` keeps another one, or a shorter test of the same
claim."""

QUICK_ROS = (
    "test/ros/test_whole_run.py::test_a_run_loses_nothing",
    "test/ros/test_whole_run.py::test_a_run_leaves_bag_result_report_and_truth",
    "test/ros/test_whole_run.py::test_live_estimates_come_once_a_second_of_data",
    "test/ros/test_whole_run.py::test_the_last_live_result_is_the_offline_one",
    "test/ros/test_robustness.py::test_a_node_that_fails_is_reported_in_one_line",
    "test/ros/test_sockets.py::test_the_sockets_of_a_domain_are_bound_to_the_loopback_interface",
)
"""Tests over DDS that `make test` keeps; all others marked `ros` start nodes and wait for them in `.ci/run`."""


def is_thorough(name: str, over_dds: bool) -> bool:
    """Say whether a test is left to `.ci/run`.

    Parameters
    ----------
    name : str
        Of the test, as pytest prints it, from the root of the repository.
    over_dds : bool
        Whether it starts nodes (marker `ros`).
    """
    if over_dds:
        return not any(names(row, name) for row in QUICK_ROS)
    if any(names(row, name) for row in THOROUGH):
        return True
    file, _, test = name.partition("::")
    if file in LONG and not LONG[file]:
        return True
    return any(names(row, test) for row in (*LONG.get(file, ()), *VARIANTS.get(file, ())))


def names(row: str, test: str) -> bool:
    """Say whether a row names a test: itself, its folder or file, or the function of its parameters.

    Parameters
    ----------
    row, test : str
        From the same place: the root of the repository, or a file.
    """
    return test == row or test.startswith((f"{row}/", f"{row}::", f"{row}["))
