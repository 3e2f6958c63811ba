"""One kind of work that a tab has done for it again and again."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck

if TYPE_CHECKING:
    from softreach.studio.session import Session

__all__ = ["AskedJob", "Job"]


class Job(ABC):
    """Work that follows from some part of the state; a session has one of each kind."""

    def __init__(self, session: Session) -> None:
        """Work for a session, which it reads, and where it leaves what it finds."""
        self.session = session

    @staticmethod
    @abstractmethod
    def depends_on(state: StudioState) -> object:
        """The part of the state that decides the result."""

    @abstractmethod
    def run(self, check: StaleCheck) -> None:
        """Do the work for the state of the session as it is now, on a thread of its own.

        Args:
            check: To be called between stages; raises if the work is no longer wanted.
        """


class AskedJob(Job):
    """Work that no state asks for, but a person who presses a button."""

    wanted = False
    """Whether somebody pressed it since the work was last done."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """Nothing."""
        del state

    def run(self, check: StaleCheck) -> None:
        """Do the work once for each time it was asked for."""
        wanted, self.wanted = self.wanted, False
        if wanted:
            self.do(check)

    @abstractmethod
    def do(self, check: StaleCheck) -> None:
        """Do the work; as `run`."""
