"""All targets, by name."""

from tests.tools.fuzz.target import Target
from tests.tools.fuzz.targets.air import AirSent, Heard, Terms
from tests.tools.fuzz.targets.campaign_folders import CampaignFolders
from tests.tools.fuzz.targets.control import Control, Page, Replies
from tests.tools.fuzz.targets.epuck2 import Commands as Epuck2Commands
from tests.tools.fuzz.targets.epuck2 import Sensed as Epuck2Answers
from tests.tools.fuzz.targets.join import Given, Join, Offered
from tests.tools.fuzz.targets.measured import RadioLogs, RobotLogs, Traces
from tests.tools.fuzz.targets.observed import Glimpses, Scenes
from tests.tools.fuzz.targets.radio import Poses, Questions, Radio
from tests.tools.fuzz.targets.ros2 import Commanded, Told
from tests.tools.fuzz.targets.run_folders import RunFolders
from tests.tools.fuzz.targets.runner_frames import RunnerFrames
from tests.tools.fuzz.targets.scenarios import Bodies, Campaigns, Scenarios
from tests.tools.fuzz.targets.settings import Certificates, Fleets, Settings
from tests.tools.fuzz.targets.world_frames import WorldFrames

ALL: tuple[type[Target], ...] = (
    *(WorldFrames, RunnerFrames, Join, Offered, Given),
    *(Scenes, Glimpses, Control, Replies, Page),
    *(Scenarios, Bodies, Campaigns),
    *(Epuck2Commands, Epuck2Answers, Told, Commanded),
    *(RunFolders, CampaignFolders, Traces, RadioLogs, RobotLogs),
    *(Fleets, Settings, Certificates),
    *(Terms, Heard, AirSent, Radio, Poses, Questions),
)
TARGETS = {target.name: target for target in ALL}
