"""The section on the largest bodies filled from a mesh, from the summaries of their runs."""

import json

from pages.tables import markdown_table


def add(page, results):
    """Adds the section, if there are summaries."""
    files = sorted(results.glob("gpu_mesh_*.json"), key=lambda file: json.loads(file.read_text())["phyxels"])
    if not files:
        return
    page.paragraph("## The largest bodies from a mesh")
    cells = []
    for file in files:
        run = json.loads(file.read_text())
        seconds = run["seconds"]
        cells.append([run["phyxels"], run["closure"], run["device"].split(",")[0], run["program"].split()[-1].strip("()"),
                      f"{seconds['model']:.4g}", f"{seconds['backend'] + seconds['time step']:.3g}",
                      f"{run['steps_per_second']:.4g}", f"{run['phyxel_steps_per_second'] * 1e-9:.3g}",
                      f"{run['bytes'] / run['phyxels']:.0f}", f"{run['energy_drift']:.1e}"])
    page.paragraph("Summaries (`run.json`) of runs of `cheburashka.obj`, free and turning, in float, on one GPU and 16 cores. "
                   "*Model*: sampling on the CPU, neighbours and, where gradients are closed, closing on the GPU. "
                   "*Energy drift*: relative, over the 200 steps of each run.")
    page.add(markdown_table(["phyxels", "closure", "GPU", "commit", "model [s]", "backend and step limit [s]", "steps/s",
                             "10⁹ phyxel-steps/s", "bytes per phyxel on the GPU", "energy drift"], cells))
