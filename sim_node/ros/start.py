"""(ROS) The start of a simulation: when its first episode may begin."""

from collections.abc import Callable

from sim_node.errors import InvalidInput
from sim_node.ros.node_base import RosNode
from sim_node.ros.simulations import Announcement

_PERIOD = 0.02  # seconds between checks


class Start:
    """Begins the first episode as soon as this is the only simulation, and it is recorded.

    Args:
        node: node of the simulation, which ends if there is another simulation in its namespace, or
            if it is not recorded in time.
    """

    def __init__(self, node: RosNode) -> None:
        self._node, self._created = node, node.listening.now()
        self._announcement = Announcement(node)
        self.identity = self._announcement.identity

    @property
    def alone(self) -> bool:
        """Return whether no other simulation of this namespace is known."""
        return self._announcement.alone

    def begin_when_possible(
        self, offer: Callable[[], None], begin: Callable[[], None],
        unrecorded: Callable[[], list[str]], limit: float,
    ) -> None:
        """Call two functions once, as soon as the first episode may begin.

        Args:
            offer: creates what only one simulation should offer; called as soon as this is it.
            begin: begins the episode.
            unrecorded: returns the topics to which recorders have not subscribed yet.
            limit: how long to wait for recorders [s].
        """

        def check() -> None:
            known = self.alone
            try:
                if not self._announcement.may_begin():
                    return
            except InvalidInput as error:
                self._node.fail(str(error))
                return
            if not known:
                offer()
            missing = unrecorded()
            if not missing:
                timer.cancel()
                begin()
            elif self._node.listening.now() - self._created > limit:
                self._node.fail(
                    f'after {limit:g} s recorders have not subscribed to: {", ".join(missing)}'
                )

        timer = self._node.create_timer(_PERIOD, check)
