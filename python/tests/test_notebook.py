"""The notebook of the first knee, run cell by cell: by nbclient where it is installed, else as plain Python."""

import json
import os
import shutil

import pytest

pytest.importorskip("pandas")
pytest.importorskip("matplotlib")

NOTEBOOK = os.path.join(os.path.dirname(__file__), "..", "examples", "first_knee.ipynb")


@pytest.fixture
def cells():
    with open(NOTEBOOK, encoding="utf-8") as file:
        return json.load(file)["cells"]


@pytest.fixture
def place(specimen, build, tmp_path, monkeypatch):
    """A folder in which the notebook's knee is built already."""
    shutil.copytree(specimen, tmp_path / "my-knee")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MPLBACKEND", raising=False)  # a kernel draws into the page
    return tmp_path


def test_the_notebook_is_kept_without_outputs(cells):
    assert not [cell for cell in cells if cell["cell_type"] == "code" and (cell["outputs"] or cell["execution_count"])]
    assert os.path.getsize(NOTEBOOK) < 16_000


def test_every_cell_runs_as_plain_python(cells, place):
    import matplotlib

    matplotlib.use("Agg")
    names = {}
    for number, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"first_knee.ipynb cell {number}", "exec"), names)
    assert len(names["as_built"]) == len(names["trials"]) and len(names["passive"]) > 2


def test_every_cell_runs_in_a_notebook(place):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    page = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(page)
    nbclient.NotebookClient(page, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(place)}}).execute()
    shown = [output for cell in page.cells if cell.cell_type == "code" for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in shown) == 3
    assert not [output for output in shown if output.output_type == "error"]
