"""One emulated base on the network: its topics on the keys of a bridge and of rmw_zenoh, and its place in the graph."""

from functools import partial
from typing import Any

import zenoh

from swarmwire.comms.robots.ros2.keys import (
    READ,
    TWIST,
    TWIST_STAMPED,
    WRITE,
    RmwNode,
    absolute,
    bridge_key,
    bridge_token,
    rmw_key,
)
from swarmwire.comms.robots.ros2.links import Inlet, Outlet
from swarmwire.comms.robots.ros2.messages import Messages, decode_either, decode_twist, decode_twist_stamped
from swarmwire.world.gateways.ros2.command_inbox import CommandInbox
from swarmwire.world.gateways.ros2.tellers import Teller

COMMAND_TOPIC, NODE = "cmd_vel", "base"


class Base:
    """A base that takes Twist and TwistStamped on `cmd_vel`, and has a topic for each teller.

    Attributes:
        inbox: its commands.
        outlets: for each teller, where its messages go out: to nodes behind a bridge, and to those of rmw_zenoh.
    """

    def __init__(
        self,
        session: zenoh.Session,
        node: RmwNode,
        tellers: tuple[Teller, ...],
        messages: Messages,
        inbox: CommandInbox,
        *,
        stamped: bool,
    ) -> None:
        """`node` is what it is in the graph of rmw_zenoh; `stamped` is which kind of command the graphs tell of."""
        self.inbox = inbox
        self._session = session
        topics = [(WRITE, teller.topic, teller.kind) for teller in tellers]
        topics.append((READ, COMMAND_TOPIC, TWIST_STAMPED if stamped else TWIST))
        named = [(way, absolute(node.namespace, topic), kind, messages.hash_of(kind)) for way, topic, kind in topics]
        in_rmw = [node.topic_token(place, *of) for place, of in enumerate(named, start=1)]
        self._tokens = [node.token, *in_rmw, *(bridge_token(node.zid, *of) for of in named)]
        self._declared: list[Any] = []
        self.outlets = [
            (
                Outlet(session, bridge_key(topic), None),
                Outlet(session, rmw_key(node.domain, topic, kind, type_hash), token),
            )
            for (way, topic, kind, type_hash), token in zip(named, in_rmw, strict=True)
            if way == WRITE
        ]
        topic, domain = absolute(node.namespace, COMMAND_TOPIC), node.domain
        self._commands = (
            (bridge_key(topic), decode_either, False),
            (rmw_key(domain, topic, TWIST), decode_twist, True),
            (rmw_key(domain, topic, TWIST_STAMPED), decode_twist_stamped, True),
        )
        self._inlets: list[Inlet] = []
        self.show()

    def show(self) -> None:
        """Take commands, and let the graphs have it; nothing happens if they do."""
        if self._inlets:
            return
        self.inbox.is_open = True
        for key, decode, attached in self._commands:
            take = partial(self.inbox.take, decode=decode)
            self._inlets.append(Inlet(self._session, key, attached=attached, take=take, refuse=self.inbox.refuse))
        self._declared = [self._session.liveliness().declare_token(token) for token in self._tokens]

    def hide(self) -> None:
        """Vanish from the graphs, as a base that was switched off; nothing happens if it did."""
        if not self._inlets:
            return
        for token in self._declared:
            token.undeclare()
        for inlet in self._inlets:
            inlet.close()
        self._declared, self._inlets = [], []
        self.inbox.is_open = False
        self.inbox.forget()
