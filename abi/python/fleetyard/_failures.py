"""The ways in which a call fails."""


class Failure(Exception):
    """Ends a call with a status other than solved, and says why."""

    status = "internal-error"

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message


class Infeasible(Failure):
    """The instance has no solution, and the planner proved it."""

    status = "infeasible"


class TimedOut(Failure):
    """The time of the budget ran out."""

    status = "timed-out"


class GaveUp(Failure):
    """The planner stopped trying without a proof: a limit of nodes or memory was reached,
    or nothing was left to try."""

    status = "gave-up"


class Cancelled(Failure):
    """The call ended because the host asked for it."""

    status = "cancelled"


class Unsupported(Failure):
    """The plugin cannot handle this kind of instance, map or option."""

    status = "unsupported"


class InvalidInput(Failure):
    """The input contradicts itself."""

    status = "invalid-input"


class InternalError(Failure):
    """The plugin failed. Any other exception means the same."""
