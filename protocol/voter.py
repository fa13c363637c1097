"""What one voter may promise: the rules on which it rests that two leaders never hold a lease at once.

A *promise* names a reign: an epoch, a leader and its incarnation. It *runs* for one lease from each vote that the
voter says for it, by the voter's own clock, and while it runs nobody else is promised anything.

=========  ============================================================================================
renew      the reign of the last promise, at any time: the promise runs anew; nothing is written
promise    a higher epoch, if the last promise has run out, or is one to the same process of the same peer
rest       nothing at all for one lease after a restart: a promise may be running that was forgotten
=========  ============================================================================================

A promise is said when it is on disk. While it is being written it binds already.
"""

from __future__ import annotations

import math

from protocol.messages import Reign


class Voter:
    """The promises of one peer. Times are of its own clock, in seconds.

    Args:
        promise: the last one on disk; None if there is no file.
        lease_s: how long a promise runs.
        now_s: when the process began.
        first: whether no process has borne the name before, so that nothing can have been promised.
    """

    def __init__(self, promise: Reign | None, lease_s: float, now_s: float, *, first: bool = False) -> None:
        self.promise = promise
        """The last one made; it is on disk."""
        self.runs_until_s = -math.inf
        """Until when the last promise binds; after a start :attr:`rests_until_s` stands in for it."""
        self.rests_until_s = now_s if first else now_s + lease_s
        """Before this nothing is promised or renewed."""
        self.writing: Reign | None = None
        """The promise that is on its way to the disk."""
        self._lease_s = lease_s

    def is_free(self, now_s: float) -> bool:
        """Whether it may promise anybody a higher epoch."""
        return self.writing is None and now_s >= self.rests_until_s and now_s >= self.runs_until_s

    def has_promised(self, reign: Reign) -> bool:
        """Whether its last promise is to the leader of this reign, for this epoch or a later one."""
        last = self.promise
        return last is not None and _is_same_process(last, reign) and reign.epoch <= last.epoch

    def renew(self, reign: Reign, now_s: float) -> bool:
        """Let the last promise run anew, if this is it. Says whether it does."""
        if self.writing is not None or reign != self.promise or now_s < self.rests_until_s:
            return False
        self.runs_until_s = now_s + self._lease_s
        return True

    def may_promise(self, reign: Reign, now_s: float) -> bool:
        """Whether the rules allow a new promise."""
        if self.writing is not None or now_s < self.rests_until_s:
            return False
        last = self.promise
        if last is None:
            return True
        return reign.epoch > last.epoch and (_is_same_process(last, reign) or now_s >= self.runs_until_s)

    def begin(self, reign: Reign, now_s: float) -> None:
        """Bind itself to what :meth:`may_promise` allows; it is to be written now."""
        self.writing = reign
        self.runs_until_s = now_s + self._lease_s

    def finish(self, now_s: float) -> None:
        """The promise is on disk, and may be said now."""
        self.promise, self.writing = self.writing, None
        self.runs_until_s = now_s + self._lease_s

    def fail(self, rests_until_s: float) -> None:
        """The promise may or may not be on disk. It is never said; nothing is promised for a while."""
        self.writing = None
        self.rests_until_s = rests_until_s

    def release(self, reign: Reign, now_s: float) -> None:
        """The leader of this reign will not lead in it, nor in one before: such a promise binds no longer."""
        last = self.writing or self.promise
        if last is not None and _is_same_process(last, reign) and last.epoch <= reign.epoch:
            self.runs_until_s = min(self.runs_until_s, now_s)


def _is_same_process(one: Reign, other: Reign) -> bool:
    return (one.leader, one.incarnation) == (other.leader, other.incarnation)
