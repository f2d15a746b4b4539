"""What all windows share: settings, desks, workers, the rig that is armed, and who looks on."""

from collections import Counter
from dataclasses import replace
from typing import Any

from hmpim.workbench.campaigns import Campaigns
from hmpim.workbench.desks import Desk, Desks
from hmpim.workbench.rig import RigBench
from hmpim.workbench.settings import Settings
from hmpim.workbench.workers import Workers

__all__ = ["Window", "Workbench"]


class Workbench:
    """The one workbench of a server.

    Parameters
    ----------
    settings : Settings
        How it was started.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.desks = Desks(settings.desks)
        self.workers = Workers()
        self.rig = RigBench(settings, present=lambda desk: desk in self.open_desks)
        self.campaigns = Campaigns(settings)
        self._tabs: dict[str, Counter[str]] = {}

    def start(self) -> None:
        """Begin what runs beside the pages."""
        self.workers.start()
        self.rig.prepare()

    def stop(self) -> None:
        """End it; a rig that moves comes to rest first."""
        self.rig.close()
        self.campaigns.stop()
        self.workers.stop()

    def opened(self, desk: str, tab: str) -> bool:
        """Note that a tab shows a desk; return whether another tab has it open."""
        tabs = self._tabs.setdefault(desk, Counter())
        tabs[tab] += 1
        return any(count > 0 for other, count in tabs.items() if other != tab)

    def closed(self, desk: str, tab: str) -> None:
        """Note that a tab shows it no longer."""
        self._tabs.get(desk, Counter())[tab] -= 1

    @property
    def open_desks(self) -> set[str]:
        """Desks that some window shows."""
        return {name for name, tabs in self._tabs.items() if any(n > 0 for n in tabs.values())}


class Window:
    """One page in one browser window, at its desk.

    Parameters
    ----------
    workbench : Workbench
        Shared by all.
    name : str
        Of the desk.
    """

    def __init__(self, workbench: Workbench, name: str) -> None:
        self.workbench = workbench
        self.name = name

    @property
    def desk(self) -> Desk:
        """The desk as it is now."""
        desk = self.workbench.desks.get(self.name)
        return self.workbench.desks.put(Desk(name=self.name)) if desk is None else desk

    def change(self, **changes: Any) -> Desk:
        """Change the desk, and keep it; return it.

        Parameters
        ----------
        **changes
            Fields of `Desk`.
        """
        return self.workbench.desks.put(replace(self.desk, **changes))
