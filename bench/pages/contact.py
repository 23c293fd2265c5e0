"""docs/contact.md: the examples of contact beside mechanics, from the table of scripts/measure_contact_examples.py."""
from pages.page import Page
from pages.tables import PageError, markdown_table, read_table

HEAD = """# Examples of contact

Bodies touch rigid obstacles (`[[obstacle]]`), each other and themselves (`[contact]`): [scenes.md](scenes.md) has the keys, \
[physics.md](physics.md) the formulas. `phyxel run examples/clap/scene.toml` runs one of the scenes below and draws it; `phyxel \
report` makes a page in which it can be turned and coloured, with a chart of what becomes of its energy. Both show obstacles where \
they are at the time of each frame, with shadows: planes as a patch of floor beside the bodies, hollow ones from within. The scene \
in the frames places them; meshes of obstacles are read again from the scene's folder, and one that is gone is left out with a \
note. `phyxel render out/clap --colour von_mises` colours pictures by a field of the frames. For a GPU, \
`scripts/bin_of_dinos.py bin.toml` writes a scene of a thousand dinos in a bin."""

#: The case of impacts by both methods of contact.
METHODS = "methods"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Case:
    """The quantities of one case of the table, as text for the page."""

    def __init__(self, table, name):
        self.table, self.name = table, name

    def row(self, quantity):
        found = self.table.find(case=self.name, quantity=quantity)
        if not found:
            raise PageError(f"{self.table.file}: no quantity \"{quantity}\" of case \"{self.name}\"; allowed: a table of "
                            "scripts/measure_contact_examples.py")
        return found

    def value(self, quantity, digits=3, factor=1):
        """The measured value times a factor, with a number of digits."""
        return short(factor * self.row(quantity).number("value"), digits)

    def expected(self, quantity, digits=3, factor=1):
        return short(factor * self.row(quantity).number("expected"), digits)

    def formula(self, quantity):
        """The formula of the expected value, with its unit."""
        return self.row(quantity)["source"]

    def percent(self, quantity, digits=2):
        return f"{self.value(quantity, digits, 100)}%"

    def power(self, quantity):
        """The value as a power of ten with one digit: for what is zero but for rounding."""
        digit, _, power = f"{self.row(quantity).number('value'):.0e}".partition("e")
        return f"{digit} · 10{str(int(power)).translate(_SUPERSCRIPTS)}" if power and digit != "0" else digit


def short(value, digits):
    """A number with some digits, without an exponent if it is neither large nor small."""
    return f"{value:.{digits}g}"


def introduction(page, table):
    times = [row.positive("value") for row in table.where(quantity="processor time")]
    if not times:
        raise PageError(f"{table.file}: no quantity \"processor time\"; allowed: a table of scripts/measure_contact_examples.py")
    page.paragraph(HEAD)
    page.paragraph(
        f"A scene takes between {min(times):.0f} and {max(times):.0f} s of one core, without pictures, and a test holds it, or a "
        "coarser copy, against mechanics (`ctest -R ContactsOfRuns`). The numbers are those of the scenes as they are, in single "
        "precision. This page is written by `bench/make_pages.py` from "
        f"[contact_examples.csv]({page.link}contact_examples.csv), which `scripts/measure_contact_examples.py` writes: "
        f"{table.fact('program')} on {table.fact('hardware')}; {table.fact('date')}.")


def bouncing_ball(page, table):
    case = Case(table, "bouncing_ball")
    period, contact = "time between apexes", "time of contact"
    page.paragraph("## A bouncing ball")
    page.paragraph("[examples/bouncing_ball](../examples/bouncing_ball/scene.toml): a rubber ball is thrown across a floor. Friction "
                   "makes it spin, and so gives it another speed along the floor at each bounce.")
    page.paragraph("![The ball every 60 ms, from the left to the right](pictures/contact_ball.png)")
    page.add(markdown_table(["", "measured", "expected"], [
        ["from the apex after the first bounce to the next one", f"{case.value(period, 4)} s",
         f"{case.expected(period, 4)} s: {case.formula(period)}, which is {case.expected(contact, 2, 1000)} ms "
         f"({case.formula(contact)})"],
        ["heights of both", f"{case.value('height after the first impact')} m, {case.value('height after the second impact')} m",
         f"below the fall of {case.value('fall')} m: {case.percent('loss of height in the first impact')} and "
         f"{case.percent('loss of height in the second impact')} of the height go into ringing, spin, impact and friction"],
        ["total energy in flight, losses counted, up to 1 s",
         f"constant to {case.percent('largest change of the total energy in flight over that of the fall', 1)} of the "
         f"{case.value('energy of the fall')} J of the fall", "constant"]]))


def squeezed_bear(page, table):
    case = Case(table, "squeezed_bear")
    page.paragraph("## A bear between plates")
    page.paragraph(
        "[examples/squeezed_bear](../examples/squeezed_bear/scene.toml): two plates approach each other by "
        f"{case.value('path of both plates', 3, 1000)} mm and leave {case.value('distance of the plates at the end', 4, 1000)} mm of "
        f"the bear's height of {case.value('height of the bear', 4, 1000)} mm. The mesh is an implicit surface, made by "
        "`scripts/example_meshes.py`.")
    page.paragraph("![The bear before, during and after](pictures/contact_bear.png)")
    page.paragraph(f"At rest the plates press with {case.value('force of a plate', 4)} N each; their forces differ by "
                   f"{case.power('largest difference of forces over force')} of that.")


def cradle(page, table):
    case = Case(table, "cradle")
    page.paragraph("## Newton's cradle")
    page.paragraph("[examples/cradle](../examples/cradle/scene.toml): a ball falls from 30 degrees against four that hang at rest. Arms "
                   "and axles are a part of each body, of a lighter material, and the middle line of each axle is held.")
    page.paragraph("![The first ball falls, and the last one flies off](pictures/contact_cradle.png)")
    page.paragraph(
        f"The last ball takes {case.percent('share of the momentum that the last ball takes')} of the momentum that the first one "
        f"loses, and each of those between keeps {case.value('smallest share of those between', 2, 100)} to "
        f"{case.percent('largest share of those between')}: arms bend, and balls ring. The impulses sum to zero to rounding "
        f"({case.power('sum of impulses over that of the first ball')} of the first one).")


def rubber_rings(page, table):
    case = Case(table, "rubber_rings")
    page.paragraph("## Rubber rings")
    page.paragraph("[examples/rubber_rings](../examples/rubber_rings/scene.toml): two rings with the radii 30 and 40 mm meet at "
                   f"±{case.value('speed before')} m/s, flatten, and rebound.")
    page.paragraph("![The rings, coloured by stress](pictures/contact_rings.png)")
    page.paragraph(
        f"They part at ±{case.value('speed after')} m/s; the rest of their energy is in the vibrations that the last picture shows. The "
        "sum of their momenta is zero to rounding in floats "
        f"({case.power('largest momentum over that of one ring')} of that of a ring), the total energy differs by "
        f"{case.percent('change of the total energy')} at the end and by up to "
        f"{case.percent('largest change of the total energy')} while they touch, and the deepest point is "
        f"{case.value('largest depth in spacings', 2)} spacings inside the other ring.")


def clap(page, table):
    case = Case(table, "clap")
    page.paragraph("## A horseshoe that claps")
    page.paragraph("[examples/clap](../examples/clap/scene.toml): two equal and opposite pulls, 8 ms long, send the arms of a horseshoe "
                   "against each other while it flies and turns: a body that touches itself (`self = true`).")
    page.paragraph("![The horseshoe, coloured by stress](pictures/contact_clap.png)")
    page.paragraph(
        f"In the last frame before they touch, the tips approach each other at "
        f"{case.value('speed of the tips in the last frame before they touch', 2)} m/s; the speed of sound in rubber that soft is "
        f"{case.value('speed of sound', 2)} m/s ({case.formula('speed of sound')}). The arms, "
        f"{case.value('thickness of the arms', 2, 1000)} mm thick, are "
        f"{case.value('smallest distance between the middles of the tips', 2, 1000)} mm apart from middle to middle in the frame in "
        f"which they are nearest, and the deepest point is {case.value('largest depth in spacings', 2)} spacings inside. The momentum is "
        f"constant throughout, the angular momentum once the pulls are over, to rounding in floats "
        f"({case.power('largest change of the momentum over it')} and "
        f"{case.power('largest change of the angular momentum after the pulls over it')} of them).")


def skittles(page, table):
    case = Case(table, "skittles")
    rolling, sliding = "speed of rolling", "time of sliding"
    page.paragraph("## A ball and skittles")
    page.paragraph("[examples/skittles](../examples/skittles/scene.toml): a ball slides, begins to roll, and runs into ten skittles.")
    page.paragraph("![The ball among the skittles](pictures/contact_skittles.png)")
    page.paragraph(
        f"A solid ball that starts to slide at v = {case.value('speed of sliding')} m/s rolls at {case.expected(rolling)} m/s "
        f"({case.formula(rolling)}) after {case.expected(sliding, 2)} s ({case.formula(sliding)}). Without skittles in its way the ball "
        f"rolls at {case.percent('speed of rolling over that expected', 3)} of that: it is soft, and flattened where it touches, so "
        "that friction has a shorter lever arm.")


def dice(page, table):
    case = Case(table, "dice")
    page.paragraph("## Dice")
    page.paragraph("[examples/dice](../examples/dice/scene.toml): three dice, obstacles with a density and so free rigid bodies, are "
                   "thrown across a table into a rubber cushion.")
    page.paragraph("![The dice on their way](pictures/contact_dice.png)")
    page.paragraph(
        "Each comes to rest with a face on the table, its middle half an edge above it to rounding "
        f"(within {case.power('largest distance of a middle from half an edge above the table')} m, at "
        f"{case.power('largest speed at the end')} m/s). `rigid.csv` has where they are and how they turn.")


def methods(page, table):
    case = Case(table, METHODS)
    page.paragraph("## Contact that keeps energy")
    page.paragraph(
        "Verlet's steps move points out of what they have been led into, which loses the energy of the impact of a layer of phyxels. "
        "Where energy has to close, `method = \"penalty\"` in `[contact]` (for bodies, and for obstacles that do not say otherwise) or in "
        "an `[[obstacle]]` lets springs push points back ([physics.md](physics.md), *Penalties in Verlet's steps*); a scene with obstacles "
        "alone needs no `[contact]`. What the springs store is `contact_energy` in `energy.csv`. Measured in double, with the default "
        "`stiffness` β = 0.1, of the balls 7 phyxels across and the bars in `scripts/contact_methods.py`; M is the modulus of pressure waves:")
    depth, wave = "{}: depth under a block in spacings", "{}: time of contact of bars over that of waves"
    error = "penalty: error of the energy on an obstacle"
    longer = [short(100 * (case.row(wave.format(method)).number("value") - 1), 2) for method in ("projected", "penalty")]
    page.add(markdown_table(["", "`\"projected\"`", "`\"penalty\"`"], [
        ["energy of an impact on an obstacle",
         f"{case.percent('projected: loss on an obstacle')} is lost, {case.percent('projected: loss on an obstacle; half the spacing')} "
         "with half the spacing",
         f"closes to second order in the step: to {case.power(error)}, to {case.power(error + '; a quarter of the step')} with a "
         "quarter of the step"],
        ["energy of balls that meet", f"{case.percent('projected: loss of balls that meet')} is lost",
         f"{case.percent('penalty: loss of balls that meet')} is lost: normals turn"],
        ["depth at a pressure p", f"hardly any ({case.power(depth.format('projected'))} spacings)",
         f"about {case.formula(depth.format('penalty'))} spacings: {case.value(depth.format('penalty'), 2)} under a block for which that "
         f"is {case.expected(depth.format('penalty'), 2)}"],
        ["largest stable step", "that without contact",
         f"{case.percent('penalty: largest step over that without contact')} of it, "
         f"{case.percent('penalty: largest step over that without contact; stiffness 1')} with `stiffness = 1`"],
        ["time of contact of bars", *(f"{more}% longer than {case.formula(wave.format('penalty'))}" for more in longer)],
        ["speeds that bars exchange", f"within {case.percent('projected: error of speeds that bars exchange', 1)}",
         f"within {case.percent('penalty: error of speeds that bars exchange', 1)}"],
        ["restitution", "can be chosen", "refused"]]))


def make(results, link):
    """The page. Raises PageError if contact_examples.csv is missing, or lacks a quantity."""
    table = read_table(results / "contact_examples.csv")
    page = Page(link)
    introduction(page, table)
    for section in (bouncing_ball, squeezed_bear, cradle, rubber_rings, clap, skittles, dice, methods):
        section(page, table)
    return page
