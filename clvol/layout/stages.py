"""The stages of a wave and the contract of each.

A contract says which queue a stage empties, where it may hand a path on to and why, and which values of the
path it reads and writes.

What moves paths is made from this table (`clvol.layout.stage_text`): the kernel of each stage, the functions
that hand a path on, `to_shade(scene, group, slot, EVENT_WALK)`, and those that read and write a path's
values.  A unit has those of its stage's contract and no others: what a contract does not name does not
compile.  A test finds what is named but not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clvol.layout.path_state import Macros


@dataclass(frozen=True)
class Queue:
    """A queue, which one stage empties in every wave.

    Parameters
    ----------
    holds : which paths wait in it.
    settled : no shadow ray of theirs is under way.  None may be of a path that has ended: its result is
        written, and its slot taken by the next.
    """

    holds: str
    settled: bool = False


QUEUES = {
    "GENERATE": Queue("paths that have ended", settled=True),
    "INTERSECT": Queue("paths with a new ray", settled=True),
    "MEDIUM": Queue("paths with media ahead on their ray"),
    "SHADE": Queue("paths to which something happened, their event"),
    "SHADOW": Queue("paths whose shadow ray is under way"),
}
IDLE = "IDLE"
"""Where slots are that hold no path: counted, in no queue until the stage that wakes them handles them."""
HANDLED = slice(len(QUEUES) + 1, 2 * len(QUEUES) + 1)
"""Of a group's counters, behind the queues' lengths and the idle slots: paths handled, by queue."""
EVENTS = {
    "ESCAPE": "the ray leaves the scene",
    "COLLISION": "the path collides in a medium",
    "SURFACE": "the ray meets a surface",
    "WALK": "the walk through media goes on in the next wave",
    "SHADOW": "the shadow ray goes on in the next wave",
}


@dataclass(frozen=True)
class Transition:
    """One way in which a stage hands a path on: the function ``to_QUEUE(scene, group, slot)`` of its unit.

    Parameters
    ----------
    to : queue, or IDLE.
    when : why.
    on : events that may lead to it, of the stage that handles events.
    sets : value of the path that is set on the way, to the function's last argument.
    events : what that may be, where the value is the event.
    shadow_ray : the path's shadow ray is under way still.
    """

    to: str
    when: str
    on: tuple[str, ...] = ()
    sets: str = ""
    events: tuple[str, ...] = ()
    shadow_ray: bool = False

    @property
    def function(self) -> str:
        """Its name in OpenCL."""
        return f"to_{self.to.lower()}"


@dataclass(frozen=True)
class Stage:
    """A stage of a wave: a kernel, and the header in cl/stages/ and the function that are named like it.

    Parameters
    ----------
    empties : the queue whose paths it handles.
    does : what, in a sentence.
    transitions : every way in which it hands a path on.
    reads, writes : values of `PATH_STATE`.  Those that transitions set are not repeated.
    needs : a macro that must be other than 0 for it to be launched.
    wakes : function that the group calls before its loop, which may put slots that are in no queue into the
        stage's own, by ``from_idle(scene, group, slot)``.
    begins : function that is called with every path first.  It hands the path on and returns false, or says
        which random numbers the stage will draw for it, so that they can be drawn in lanes.  Not of stages
        that stand by.
    stands_by : event that brings a path back in the next wave, of stages whose walks may take long: a
        work-item that has taken its share of steps hands its other paths on with this event.  The stage's
        function returns the steps that it took.
    """

    name: str
    empties: str
    does: str
    transitions: tuple[Transition, ...]
    reads: frozenset[str]
    writes: frozenset[str]
    needs: str = ""
    wakes: str = ""
    begins: str = ""
    stands_by: str = ""

    @property
    def events(self) -> tuple[str, ...]:
        """Events that its code names, in the order of `EVENTS`."""
        named = {event for t in self.transitions for event in (*t.on, *t.events)}
        return tuple(event for event in EVENTS if event in named)

    @property
    def sets(self) -> frozenset[str]:
        """Path fields that its transitions set."""
        return frozenset(t.sets for t in self.transitions if t.sets)


def _fields(*words: str) -> frozenset[str]:
    return frozenset(" ".join(words).split())


_RAY = "origin direction"
_KEY = "pixel sample bounce"  # of random numbers
_COUNTS = "lookups tentative real cells violations"  # of walks
_FIRST_HIT = "depth normal albedo position met"
_FIRSTS = f"{_FIRST_HIT} alpha"
_HIT = "hit_t hit_primitive hit_u hit_v"
_PASSED = "segment after_t after_primitive"
_LEG = "leg walked walked_rest"
_LANES = "lane_steps busy_lane_steps"
_SHADOW_RAY = "shadow_direction shadow_distance shadow_primitive shadow_origin shadow_inside shadow_light"
_SHADOW_LEG = (
    "shadow_leg shadow_walked shadow_walked_rest shadow_medium "
    "shadow_segment shadow_after_t shadow_after_primitive"
)

STAGES = (
    Stage(
        "generate",
        empties="GENERATE",
        does="Writes a finished path's result and starts the next job's path in its slot.",
        transitions=(
            Transition("INTERSECT", "a job is left: a new path begins"),
            Transition(IDLE, "no job is left: the slot is empty until there are jobs again"),
        ),
        reads=_fields("job radiance sample_weight largest_weight", _COUNTS, "shadow_rays", _FIRSTS),
        writes=_fields(
            _RAY,
            _KEY,
            _COUNTS,
            "shadow_rays",
            _PASSED,
            _FIRSTS,
            "job beta radiance sample_weight channel pdf inside eta_squared largest_weight",
        ),
        wakes="wake_idle",
        begins="generate_begins",
    ),
    Stage(
        "intersect",
        empties="INTERSECT",
        does="Finds what lies ahead on the ray: the first surface, and whether media come before it.",
        transitions=(
            Transition(
                "MEDIUM",
                "a medium is on the way to a surface or to infinity; the event says to which",
                sets="event",
                events=("ESCAPE", "SURFACE"),
            ),
            Transition(
                "SHADE",
                "no medium is on the way to a surface or to infinity; the event says to which",
                sets="event",
                events=("ESCAPE", "SURFACE"),
            ),
        ),
        reads=_fields(_RAY, _KEY, _PASSED, "inside hit_t channel radiance"),
        writes=_fields(_HIT, "inside origin medium_end radiance"),
    ),
    Stage(
        "medium_sample",
        empties="MEDIUM",
        does="Walks the media ahead to a collision, or to the surface or infinity behind them.",
        transitions=(
            Transition(
                "SHADE",
                "it collides, its walk needs another wave, or it leaves the media with its event as it was",
                sets="event",
                events=("COLLISION", "WALK"),
            ),
        ),
        reads=_fields(
            _RAY,
            _KEY,
            _COUNTS,
            _LEG,
            _LANES,
            "event channel beta radiance pdf inside segment after_t hit_t medium_end",
            "largest_weight exhausted alpha sample_weight",
        ),
        writes=_fields(_COUNTS, _LEG, _LANES, "origin medium beta radiance largest_weight exhausted alpha"),
        needs="CLVOL_HAS_MEDIA",
        stands_by="WALK",
    ),
    Stage(
        "shade",
        empties="SHADE",
        does="Handles what happened to a path: gathers light, scatters it, and makes a shadow ray.",
        transitions=(
            Transition(
                "MEDIUM",
                "its walk needed another wave, and goes on",
                on=("WALK",),
                sets="event",
                events=("ESCAPE", "SURFACE"),
            ),
            Transition(
                "SHADOW",
                "it has a shadow ray, and waits for it before it goes on or ends",
                on=("COLLISION", "SURFACE", "SHADOW"),
                sets="goes_on",
                shadow_ray=True,
            ),
            Transition("INTERSECT", "it goes on without a shadow ray", on=("COLLISION", "SURFACE")),
            Transition("GENERATE", "it ended without a shadow ray", on=("ESCAPE", "COLLISION", "SURFACE")),
        ),
        reads=_fields(
            _RAY,
            _KEY,
            _HIT,
            "event goes_on channel beta radiance pdf medium segment inside eta_squared sample_weight",
            "largest_weight cut cut_energy exhausted shadow_rays alpha",
        ),
        writes=_fields(
            _RAY,
            _PASSED,
            _SHADOW_RAY,
            _FIRSTS,
            "bounce beta radiance pdf inside eta_squared",
            "largest_weight cut cut_energy exhausted shadow_rays",
        ),
        begins="shade_begins",
    ),
    Stage(
        "shadow_transmittance",
        empties="SHADOW",
        does="Attenuates the light of a shadow ray by everything on its way and adds what arrives.",
        transitions=(
            Transition(
                "SHADE",
                "the walk of its shadow ray needs another wave",
                sets="event",
                events=("SHADOW",),
                shadow_ray=True,
            ),
            Transition("INTERSECT", "its shadow ray is through, and it goes on"),
            Transition("GENERATE", "its shadow ray is through, and it has ended"),
        ),
        reads=_fields(
            _KEY, _COUNTS, _SHADOW_RAY, _SHADOW_LEG, _LANES, "origin goes_on channel radiance exhausted"
        ),
        writes=_fields(_COUNTS, _SHADOW_LEG, _LANES, "shadow_inside shadow_light radiance exhausted"),
        needs="CLVOL_NEE",
        stands_by="SHADOW",
    ),
)
"""In the order of their launches in a wave, and of the queues that they empty: a path that nothing holds up
goes from a new ray to the next one in one wave.  No stage hands a path on to the queue that it empties:
walks that need another go through `shade`."""


def stage(name: str) -> Stage:
    """The stage of that name."""
    return next(s for s in STAGES if s.name == name)


def launched(macros: Macros) -> tuple[str, ...]:
    """Names of the stages that a wave launches, in order."""
    return tuple(s.name for s in STAGES if not s.needs or macros[s.needs])


def targets(stage: Stage, macros: Macros) -> tuple[str, ...]:
    """Where a stage hands paths on to: IDLE, and queues that a launched stage empties."""
    emptied = {other.empties for other in STAGES if other.name in launched(macros)}
    found = dict.fromkeys(t.to for t in stage.transitions if t.to == IDLE or t.to in emptied)
    return tuple(found)
