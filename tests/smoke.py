"""The first tests to run after a change, one or two of each part: ``pytest -m smoke``."""

SMOKE = {
    "kernels": (
        "kernels/test_composite.py::test_blending_and_adjoint",
        "kernels/test_adam.py::test_matches_torch",
        "kernels/loss/test_image.py::test_squared_error",
        "kernels/loss/test_shape.py::test_bending",
    ),
    "rendering": (
        "rendering/test_mixed.py::test_exact",
        "rendering/test_paint.py::test_gradients",
        "rendering/test_stroker.py::test_image_and_gradients_of_dashes",
    ),
    "scene": ("scene/test_scene.py::test_take_and_append",),
    "files": (
        "files/test_image.py::test_modes",
        "files/test_image.py::test_bad_files_give_one_line_with_name_and_cause",
        "files/test_packed.py",
    ),
    "svg": (
        "svg/test_own_files.py::test_files_come_back",
        "svg/test_read_kept.py::test_it_looks_the_same",
        "svg/test_write.py::test_the_file_looks_as_the_render",
        "test_metrics.py::test_psnr",
    ),
    "trace": ("drawing/trace/test_trace.py::test_a_logo", "drawing/trace/test_curves.py"),
    "fit": (
        "fit/test_step.py::test_evaluating_a_file_that_outgrows_the_arrays",
        "run/test_vectorize.py::test_the_loss_falls_and_the_count_stays",  # photographs
        "drawing/test_line_art.py::test_jpeg_and_grey_paper",  # line art
        "drawing/test_subjects.py::test_figures_are_of_the_file_that_is_delivered",  # drawings
        "run/test_vectorize.py::test_target_psnr_is_reached_with_few_bytes",
    ),
    "jobs": (
        "batch/test_plan.py::test_a_batch_file",
        "batch/test_batch.py::test_a_run_reports_skips_and_redoes",
        "run/test_checkpoint.py::test_a_run_goes_on_to_the_same_bytes[",
    ),
    "api": (
        "test_api.py::test_public_names_exist_and_import_quickly",
        "test_api.py::test_the_command_line_api_and_file_agree",
    ),
    "cli": (
        "cli/test_vectorize.py::test_vectorize",
        "cli/test_render.py::test_render",
        "cli/test_refusals.py::test_refusals",
        "cli/test_main.py::test_help_is_quick",
    ),
    "others": (
        "paper/test_splat.py::test_mixed_scenes",
        "paper/test_soft.py::test_image_and_gradients",
        "torch/test_gradients.py::test_exact",
        "pydiffvg/test_render.py::test_area_of_a_circle",
        "motion/test_recorder.py::test_a_film_ends_with_the_file",
        "pages/serve/test_app.py::test_an_image_becomes_the_file_of_the_command_line",
        "portable",
    ),
    "conventions": ("test_architecture.py",),
}
"""Part -> beginnings of the names that pytest gives tests, within this folder."""

NAMES = tuple(f"tests/{name}" for names in SMOKE.values() for name in names)
