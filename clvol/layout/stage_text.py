"""OpenCL text of a stage's contract: the macros of its kernel (cl/kernels/stage.cl) and its transitions."""

from __future__ import annotations

import textwrap
from functools import cache
from typing import TYPE_CHECKING

from clvol.layout.path_text import path_values
from clvol.layout.stages import EVENTS, IDLE, QUEUES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.layout.path_state import Macros
    from clvol.layout.path_text import Value
    from clvol.layout.stages import Stage, Transition

_SLOT = "const Scene *scene, uint group, uint slot"
_FROM_IDLE = """\
/* jobs are left for an idle slot */
INLINE void from_idle({slot})
{{
    queue_push(scene, group, QUEUE_{queue}, slot);
    group_atomic_add(queue_handled(scene, group, QUEUE_{queue}), -1u); /* no path has ended there */
}}"""


def stage_text(macros: Macros, stage: Stage) -> str:
    """What a stage's unit knows of queues and events: its own, and no more."""
    named = [stage.empties, *(t.to for t in stage.transitions if t.to != IDLE)]
    lines = [contract_comment(stage)]
    lines += [f"#define QUEUE_{q} {n}u /* {QUEUES[q].holds} */" for n, q in enumerate(QUEUES) if q in named]
    lines += [f"#define EVENT_{e} {n}u /* {EVENTS[e]} */" for n, e in enumerate(EVENTS) if e in stage.events]
    lines += [
        f"#define STAGE {stage.name}",
        f"#define STAGE_KERNEL {stage.name}_kernel",
        f"#define STAGE_QUEUE QUEUE_{stage.empties}",
    ]
    if stage.wakes:
        lines.append(f"#define STAGE_WAKES {stage.wakes}")
    if stage.begins:
        lines.append(f"#define STAGE_BEGINS {stage.begins}")
    if stage.stands_by:
        lines.append(f"#define STAGE_STANDS_BY EVENT_{stage.stands_by}")
    values = path_values(macros)
    if stage.wakes:
        lines.append(_FROM_IDLE.format(slot=_SLOT, queue=stage.empties))
    return "\n".join([*lines, *(_transition_text(t, values) for t in stage.transitions)]) + "\n"


def _transition_text(transition: Transition, values: Mapping[str, Value]) -> str:
    """The function that a transition is."""
    value, body = "", [f"queue_push(scene, group, QUEUE_{transition.to}, slot);"]
    if transition.to == IDLE:
        body = ["group_atomic_add(idle_slots(scene, group), 1);"]
    if transition.sets:
        value = f", uint {transition.sets}"
        body.insert(0, values[transition.sets].store(transition.sets))
    lines = "\n".join(f"    {line}" for line in body)
    return f"/* {transition.when} */\nINLINE void {transition.function}({_SLOT}{value})\n{{\n{lines}\n}}"


def contract_lines(stage: Stage) -> list[str]:
    """A contract in words, a line for each part of it."""
    idle = f", and {IDLE} slots once there are jobs again" if stage.wakes else ""
    lines = [f"{stage.name}: {stage.does}", f"From: {stage.empties}, {QUEUES[stage.empties].holds}{idle}"]
    for transition in stage.transitions:
        events = f" [{', '.join(transition.events)}]" if transition.events else ""
        lines.append(f"To: {transition.to}{events}, {transition.when}")
    lines.append(f"Reads: {', '.join(sorted(stage.reads))}")
    sets = sorted(stage.writes | stage.sets)
    return [*lines, f"Writes: {', '.join(sets)}"]


@cache
def contract_comment(stage: Stage) -> str:
    """The contract as a comment, which stands before the transitions that are made from it."""
    lines = [
        part
        for line in contract_lines(stage)
        for part in textwrap.wrap(line, 112, initial_indent="   ", subsequent_indent="       ")
    ]
    return "/* " + "\n".join(lines).strip() + " */"
