"""Tables of how fast meshes are filled with phyxels, as `phyxel bench sample` writes them."""

from pages.tables import markdown_table

STAGES = ["surface_s", "place_s", "relax_s", "volumes_s"]


def add_tables(page, tables, measured):
    """Adds an explanation, and the tables; measured(table) says by what each was measured."""
    page.paragraph("`phyxel bench sample`. Seconds, of the whole and of its stages; bytes are the most memory in use at a "
                   "time, with the cloud itself. The smallest gap between two phyxels is relative to the mean distance to "
                   "the nearest; *uneven*: the relative standard deviation of that distance.")
    for table in tables:
        page.paragraph(f"{measured(table)}:")
        page.add(markdown_table(
            ["mesh", "triangles", "threads", "phyxels", "on the surface", "phyxels/s", "s", "surface", "lattice", "evening out",
             "volumes", "bytes/phyxel", "smallest gap", "uneven"],
            [[row["mesh"], row["triangles"], row["threads"], row["phyxels"], row["on_surface"],
              f"{row.number('phyxels_per_s'):,.0f}", row["seconds"], *(row[stage] for stage in STAGES),
              row["bytes_per_phyxel"], row["smallest_gap"], f"{row.number('gap_spread'):.1%}"] for row in table.rows]))
