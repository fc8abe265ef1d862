#!/usr/bin/env python3
"""What `make drives` runs, resumes and writes: with a program that answers at once in stillmap's place."""
import json
import os
import pathlib
import sys
import tempfile
import unittest

import drives
import page
import suite

PROGRAM = """#!{python}
import json, pathlib, sys
words = sys.argv[1:]
log = pathlib.Path(sys.argv[0]).with_name("calls")
log.open("a").write(" ".join(words) + "\\n")
if words[0] == "simulate":
    pathlib.Path(words[1]).mkdir()
    sys.exit(0)
if words[:2] == ["evaluate", "trajectory"]:
    print(json.dumps({{"kitti": None, "ate_rmse_m": 0.5, "relative": {{"mean_translation_m": 0.02}}}}))
    sys.exit(0)
if "{failing}" and "{failing}" in words[2]:
    sys.exit("no such drive")
weightings = words[words.index("--weightings") + 1:words.index("--json")]
print(json.dumps([{{
    "weighting": weighting, "scans": 60, "rejected": 1, "good": 57, "degenerate": 1, "lost": 2, "voxels": 5000,
    "median_ms": 10.0, "p99_ms": 20.0, "health": {{"poses": 60, "wrong": 2, "wrong_called_good": [7],
                                                  "right_called_bad": [9, 11]}},
    "trajectory": {{"kitti": {{"translation_percent": 0.1}}, "ate_rmse_m": 0.02,
                   "relative": {{"mean_translation_m": 0.001}}}}}} for weighting in weightings]))
"""
OTHER_PROGRAM = """#!{python}
import pathlib, sys
out = pathlib.Path(sys.argv[2])
out.joinpath("poses_lidar.txt").write_text("")
out.joinpath("ms.txt").write_text("30\\n40\\n50\\n")
"""


class Suite(unittest.TestCase):
    def test_simulates_ten_seeds_of_each_preset(self):
        runs = suite.suite(suite.Extent())
        for preset in suite.PRESETS:
            seeds = {run.drive for run in runs
                     if run.group == f"{preset}, 64 beams" and (run.labels, run.mutation) == ("files", "none")}
            self.assertEqual(len(seeds), 10)

    def test_names_every_run_differently(self):
        for extent in (suite.Extent(), suite.Extent.quick()):
            names = [run.name for run in suite.suite(extent, programs=[("other", "/bin/other")])]
            self.assertEqual(len(names), len(set(names)))

    def test_takes_the_weightings_that_are_asked_for(self):
        programs = [("other", "/bin/other")]
        runs = list(suite.weighed(suite.suite(suite.Extent.quick(), programs=programs), ["none", "geometric"]))
        self.assertEqual({run.weightings for run in runs}, {("none", "geometric"), ("other",)})
        self.assertFalse([run for run in runs if run.mutation != "none"], "mutated ones are semantic")
        self.assertEqual(list(suite.weighed(suite.suite(suite.Extent.quick()), suite.WEIGHTINGS)),
                         suite.suite(suite.Extent.quick()))

    def test_covers_weightings_labels_sensors_sweeps_and_mutations(self):
        runs = suite.suite(suite.Extent())
        self.assertEqual({weighting for run in runs for weighting in run.weightings}, set(suite.WEIGHTINGS))
        self.assertLessEqual({"files", "model", *suite.WRONG_LABELS}, {run.labels for run in runs})
        self.assertEqual({run.mutation for run in runs}, {"none", *suite.MUTATIONS})
        for word in (",rolling", "sensor=vlp_16", "sensor=hdl_32e", "motion=hard_turns", "motion=handheld"):
            self.assertTrue(any(word in run.drive for run in runs), word)

    def test_takes_the_recordings_that_are_there(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            scans = folder / "avia_campus" / "velodyne"
            scans.mkdir(parents=True)
            for name in ("0.pcd", "1.pcd", "remarks.txt", "../odom_poses.txt", "../times.txt"):
                (scans / name).touch()
            avia = drives.with_poses(folder, folder / "results")
            self.assertTrue((avia / "poses_lidar.txt").is_file())
            self.assertEqual(drives.with_poses(folder, folder / "results"), avia)
            self.assertIsNone(drives.with_poses(folder / "results", folder / "results"))
            (folder / "vlp16").mkdir()
            for name in ("1.5.pcd", "1.6.pcd", "README"):
                (folder / "vlp16" / name).touch()
            runs = list(suite.recorded(folder, avia))
        self.assertEqual({run.scans for run in runs}, {2})
        self.assertEqual([run.judged for run in runs if run.drive.endswith("vlp16")], [False])
        self.assertNotIn("other_place", {run.mutation for run in runs})


class Page(unittest.TestCase):
    def test_replaces_what_stands_between_the_markers(self):
        text = f"before\n{page.BEGIN}\nold\n{page.END}\nafter\n"
        once = page.put_between_markers(text, "new")
        self.assertEqual(once, f"before\n{page.BEGIN}\nnew\n{page.END}\nafter\n")
        self.assertEqual(page.put_between_markers(once, "new"), once)

    def test_refuses_a_page_without_markers(self):
        with self.assertRaises(ValueError):
            page.put_between_markers("nothing", "new")

    def test_gives_medians_and_the_worst_of_what_is_known(self):
        self.assertEqual(page.median_and_worst([0.1, None, 0.3, 0.2], 1), "0.2 / 0.3")
        self.assertEqual(page.median_and_worst([None], 1), "-")


class Drives(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.scratch.name)
        (self.folder / "page.md").write_text(f"# Page\n{page.BEGIN}\n{page.END}\n")
        self.write_program()

    def tearDown(self):
        self.scratch.cleanup()

    def write_program(self, failing=""):
        self.write("stillmap", PROGRAM.format(python=sys.executable, failing=failing))

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text)
        path.chmod(0o755)
        return path

    def run_drives(self, *words):
        return drives.main(["--program", str(self.folder / "stillmap"), "--results", str(self.folder / "results"),
                            "--page", str(self.folder / "page.md"), "--quick", *words])

    def calls(self):
        return (self.folder / "calls").read_text().splitlines()

    def test_writes_the_page_and_does_not_repeat_what_is_finished(self):
        self.assertEqual(self.run_drives("--only", "quiet, 16 beams"), 0)
        self.assertEqual(len(self.calls()), 2)
        text = (self.folder / "page.md").read_text()
        self.assertIn("| quiet, 16 beams: 2 of 60 scans | true | semantic | 0.100 / 0.100 | 0.020 / 0.020 "
                      "| 0.10 / 0.10 | 2 of 4 | 4 of 116 | 4, 2 | 5.0 | 10.0 / 20.0 |", text)
        self.assertEqual(self.run_drives("--only", "quiet, 16 beams"), 0)
        self.assertEqual(len(self.calls()), 2)
        self.assertEqual((self.folder / "page.md").read_text(), text)
        self.assertEqual(self.run_drives("--only", "quiet, 16 beams", "--fresh"), 0)
        self.assertEqual(len(self.calls()), 4)

    def test_keeps_other_drives_on_the_page(self):
        self.run_drives("--only", "quiet, 16 beams")
        self.run_drives("--only", "quiet, 32 beams")
        text = (self.folder / "page.md").read_text()
        self.assertIn("| quiet, 16 beams: ", text)
        self.assertIn("| quiet, 32 beams: ", text)

    def test_goes_on_after_a_line_that_was_cut_off(self):
        self.run_drives("--only", "quiet, 16 beams")
        file = self.folder / "results" / "runs.jsonl"
        file.write_text(file.read_text()[:-20])
        self.assertEqual(self.run_drives("--only", "quiet, 16 beams"), 0)
        self.assertEqual(len(self.calls()), 3)
        self.run_drives("--only", "quiet, 16 beams")
        self.assertEqual(len(self.calls()), 3)

    def test_goes_on_after_a_run_that_fails_and_repeats_it(self):
        self.write_program(failing="seed=101")
        self.assertEqual(self.run_drives("--only", "quiet, 16 beams"), 1)
        self.assertIn("1 of 60 scans", (self.folder / "page.md").read_text())
        self.write_program()
        self.assertEqual(self.run_drives("--only", "quiet, 16 beams"), 0)
        self.assertIn("2 of 60 scans", (self.folder / "page.md").read_text())

    def test_sums_health_over_mutations(self):
        self.assertEqual(self.run_drives("--only", "mutate=teleport"), 0)
        text = (self.folder / "page.md").read_text()
        self.assertIn("| teleport | quiet, 64 beams | true | 60 | 2 | 1 (166.7) | 2 (6.90) | 1 |", text)
        self.assertIn("| all of these | all drives | all | 120 | 4 | 2 (166.7) | 4 (6.90) | 2 |", text)

    def test_judges_no_health_by_a_truth_that_is_no_better(self):
        (self.folder / "kitti_raw_0005" / "velodyne").mkdir(parents=True)
        (self.folder / "kitti_raw_0005" / "velodyne" / "0.bin").touch()
        self.assertEqual(self.run_drives("--recordings", str(self.folder), "--only", "kitti_raw_0005 labels=none"), 0)
        text = (self.folder / "page.md").read_text()
        self.assertIn("| none | semantic | 0.100 / 0.100 | 0.020 / 0.020 | 0.10 / 0.10 | - | - | 2, 1 | 5.0 |", text)
        self.assertNotIn("| none | all drives |", text)

    def test_compares_with_another_program(self):
        other = self.write("other", OTHER_PROGRAM.format(python=sys.executable))
        self.assertEqual(self.run_drives("--only", "quiet, 16 beams", "--against", f"other={other}"), 0)
        self.assertIn("--sensor vlp_16", " ".join(self.calls()))
        self.assertIn("| quiet, 16 beams: 2 of 3 scans | none | other | - | 0.500 / 0.500 | 2.00 / 2.00 "
                      "| - | - | - | - | 40.0 / 50.0 |", (self.folder / "page.md").read_text())

    def test_names_what_cannot_be_run(self):
        self.assertEqual(self.run_drives("--only", "no such drive"), 2)
        for words in (["--against", "other"], ["--against", "other=/missing"], ["--recordings", "/missing"]):
            with self.assertRaises(SystemExit) as refused:
                sys.stderr = open(os.devnull, "w")
                try:
                    self.run_drives(*words)
                finally:
                    sys.stderr.close()
                    sys.stderr = sys.__stderr__
            self.assertEqual(refused.exception.code, 2)


if __name__ == "__main__":
    unittest.main()
