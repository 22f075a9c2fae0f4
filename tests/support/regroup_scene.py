"""Painted things on a table whose masks are mended."""

from painted_scene import STRANGE, THINGS, photograph

PLACES = {"red_box": (-0.16, 0.06), "red_can": (0.1, 0.08), "yellow_ball": (0.1, -0.05)}
PLATE, STRANGER = (-0.1, -0.18), (0.24, 0.12)
STRANGE_ID = 5


def table_of_things():
    """The things of `PLACES` with the ids 1, 2, 3, the plate, 4, and what no prior holds."""
    things = {i: (*THINGS[name], *PLACES[name]) for i, name in enumerate(PLACES, start=1)}
    things[4] = (*THINGS["green_plate"], *PLATE)
    return photograph(things | {STRANGE_ID: (*STRANGE, *STRANGER)})


def taken_for(result):
    """The name of each recognised object, by id."""
    return {item.object_id: item.outcome.name for item in result.objects if item.recognised}
