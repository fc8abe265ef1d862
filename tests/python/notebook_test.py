"""Runs the notebook's cells one after the other."""

import json
import os
from pathlib import Path

NOTEBOOK = Path(os.environ["STILLMAP_SOURCE"]) / "clients/python/recording_to_picture.ipynb"


def test_every_cell_runs_and_a_picture_comes_of_it(city, tmp_path, monkeypatch):
    monkeypatch.setenv("RECORDING", str(city))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 5
    for number, cell in enumerate(cells):
        assert cell["outputs"] == [], "outputs are not kept"
        exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    assert names["error"]["rmse_m"] < 0.2
