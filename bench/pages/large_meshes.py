"""The sections on filling meshes on a GPU, and on the largest bodies, from the summaries of their runs."""

import json

from pages import sampling
from pages.page import measured_by
from pages.tables import markdown_table, read_if_there


def add(page, results):
    """Adds how fast a GPU fills meshes, and the section on the largest bodies, as far as there are measurements."""
    filling = read_if_there(results / "gpu_sample.csv")
    if filling:
        page.paragraph("## Filling a mesh with phyxels on a GPU")
        page.paragraph("The host divides space into regions and inspects the surface; the GPU chooses and evens out the "
                       "phyxels on the surface, places and moves those inside, and finds their volumes. Clouds have the bits "
                       "of the host's. What a host takes alone: [results](results/README.md).")
        sampling.add_tables(page, [filling], lambda table: measured_by(table, "gpu"))
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
                   "*Model*: filling, neighbours and, where gradients are closed, closing on the GPU. "
                   "*Energy drift*: relative, over the 200 steps of each run.")
    page.add(markdown_table(["phyxels", "closure", "GPU", "commit", "model [s]", "backend and step limit [s]", "steps/s",
                             "10⁹ phyxel-steps/s", "bytes per phyxel on the GPU", "energy drift"], cells))
