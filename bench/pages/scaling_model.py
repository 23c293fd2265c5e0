"""A model of the time of a step on more GPUs than were measured, fitted to the tables."""
import bisect
import dataclasses
import math

from pages.tables import markdown_table

# Assumed links between nodes, which were not measured: 400 Gbit/s for each GPU.
NETWORK_BYTES_PER_S, NETWORK_LATENCY = 50e9, 5e-6


class OneGpu:
    """The time of a step on one GPU over the number of phyxels, from the table gpu_sizes.csv."""

    def __init__(self, sizes):
        self.points = sorted((row.positive("phyxels"), 1 / row.positive("steps_per_s"))
                             for row in sizes.where(bodies="1", terms="green", precision="float"))

    def seconds(self, phyxels):
        """The time of a step [s]: a power law between measured sizes, proportional to the size above them."""
        above = bisect.bisect_left([n for n, _ in self.points], phyxels)
        if above == 0:
            return self.points[0][1]
        n, t = self.points[above - 1]
        if above == len(self.points):
            return t * phyxels / n
        next_n, next_t = self.points[above]
        return t * (next_t / t) ** (math.log(phyxels / n) / math.log(next_n / n))


@dataclasses.dataclass
class Fit:
    """A linear fit of the time that exchanges add to a step over the bytes sent."""
    latency: float          #: [s]
    bytes_per_s: float
    slowdown: float         #: of one GPU on that day, relative to the table of sizes
    layers: float           #: of ghosts at a face
    bytes_per_ghost: float
    rows: int


def fitted(tables, one):
    """The fit; None for fewer than three rows, or if no row has two GPUs and a cut along the curve."""
    rows = [row for table in tables for row in table.rows
            if row["phyxels_alone"] and row.number("ranks") >= 2 and row["precision"] == "float"
            and "IPC" in row["transport"]]
    layers, slowdowns, per_ghost, points = 0, [], [], []
    for row in rows:
        alone, ghosts, sent = (row.positive(c) for c in ("phyxels_alone", "most_ghosts", "bytes_per_step"))
        slowdowns.append(alone / row.positive("phyxel_steps_per_s_alone") / one.seconds(alone))
        per_ghost.append(sent / ghosts)
        points.append((sent, 1 / row.positive("steps_per_s") - slowdowns[-1] * one.seconds(row.positive("most"))))
        if row.number("ranks") == 2 and row["cut_by"] == "curve":
            layers = ghosts / row.positive("phyxels") ** (2 / 3)  # one face each
    if len(rows) < 3 or layers == 0:
        return None
    mean_bytes, mean_seconds = (sum(p[k] for p in points) / len(points) for k in (0, 1))
    square = sum((b - mean_bytes) ** 2 for b, _ in points)
    product = sum((b - mean_bytes) * (s - mean_seconds) for b, s in points)
    if not (square > 0 and product > 0):
        return None
    return Fit(latency=max(0.0, mean_seconds - mean_bytes * product / square), bytes_per_s=square / product,
               slowdown=sum(slowdowns) / len(rows), layers=layers, bytes_per_ghost=sum(per_ghost) / len(rows),
               rows=len(rows))


def model(tables, sizes):
    """The section about the model and its forecast for up to 1,024 GPUs. Empty if there is too little to fit. `tables` come
    from `bench scaling` on GPUs."""
    one = OneGpu(sizes)
    fit = fitted(tables, one) if len(one.points) > 1 else None
    if not fit:
        return ""
    text = (
        "### A model of more GPUs\n\nThe table is a forecast, not a measurement. The time of a step is the sum of two terms: that of "
        "one GPU with the phyxels of a part (from the table of sizes, times "
        f"{fit.slowdown:.3f} for the clocks of that day), and that of the exchanges, "
        f"{1e6 * fit.latency:.1f} µs plus the bytes sent at {1e-9 * fit.bytes_per_s:.0f} GB/s: a line fitted to the "
        f"{fit.rows} rows above. Parts are cubes with {fit.layers:.2f} layers of ghosts on six faces, "
        f"{fit.bytes_per_ghost:.0f} bytes each. *Between nodes*, each GPU is assumed to have "
        f"{1e-9 * NETWORK_BYTES_PER_S:.0f} GB/s and {1e6 * NETWORK_LATENCY:.0f} µs of latency more for each of the two "
        "exchanges; no second node was available for a measurement.\n\n")
    rows = []
    for name, phyxels, each in (("17 million", 17e6, False), ("a billion", 1e9, False), ("16 million per GPU", 16e6, True)):
        for gpus in (8, 64, 512, 1024):
            part = phyxels if each else phyxels / gpus
            alone = fit.slowdown * one.seconds(part)
            sent = fit.bytes_per_ghost * 6 * fit.layers * part ** (2 / 3)
            near = alone + fit.latency + sent / fit.bytes_per_s
            far = alone + fit.latency + 2 * NETWORK_LATENCY + sent / NETWORK_BYTES_PER_S
            # One GPU with the whole body, or with its part.
            ideal = alone if each else fit.slowdown * one.seconds(phyxels) / gpus
            one_node = gpus <= 8
            rows.append([name, gpus, f"{1 / near:.0f}", f"{100 * ideal / near:.0f}%", "–" if one_node else f"{1 / far:.0f}",
                         "–" if one_node else f"{100 * ideal / far:.0f}%"])
    return text + markdown_table(["phyxels", "GPUs", "steps/s, one kind of link", "efficiency", "steps/s, between nodes",
                                  "efficiency"], rows)
