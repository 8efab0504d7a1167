"""How long a render that is to end waits for the paths that it has in flight."""

from __future__ import annotations

import time

PATIENCE_SECONDS = 10.0
"""How long paths in flight are waited for once the render is to end: hardly any path takes as long, but some
never end.  Whole passes that then lack a path are dropped."""
FIRST_PATIENCE_SECONDS = 30.0
"""The same where no pass is finished yet: without one there is no picture."""


class Patience:
    """Of one render, from when it is first asked to end."""

    def __init__(self) -> None:
        self._since: float | None = None

    def ends(self, urgency: int, some_finished: bool) -> bool:
        """Whether paths in flight are no longer waited for, by how urgently an end is asked for."""
        if urgency == 0:
            return False
        now = time.perf_counter()
        if self._since is None:
            self._since = now
        patience = PATIENCE_SECONDS if some_finished else FIRST_PATIENCE_SECONDS
        return urgency > 1 or now - self._since > patience
