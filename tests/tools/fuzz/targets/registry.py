"""All targets by name."""

from tests.tools.fuzz.target import Target
from tests.tools.fuzz.targets import folders, joining, radio, robots, settings, wire

_ALL: tuple[type[Target], ...] = (
    *(wire.WorldFrames, wire.RunnerFrames, wire.Scenes, wire.Truths),
    *(joining.Join, joining.Offers, joining.Assignments, joining.Control, joining.Replies, joining.PageOrders),
    *(radio.Terms, radio.BridgeReceived, radio.BridgeSent, radio.Packets, radio.Poses, radio.Questions),
    *(robots.Epuck2Commands, robots.Epuck2Answers, robots.Ros2Sensors, robots.Ros2Commands),
    *(settings.Scenarios, settings.Bodies, settings.Campaigns),
    *(settings.Fleets, settings.RobotSettings, settings.Certificates),
    *(folders.RunFolders, folders.CampaignFolders, folders.Traces, folders.RadioLogs, folders.RobotLogs),
)
TARGETS = {target.name: target for target in _ALL}
