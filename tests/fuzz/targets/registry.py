"""All targets, by name."""

from tests.fuzz.target import Target
from tests.fuzz.targets.air import AirSent, Heard, Terms
from tests.fuzz.targets.campaign_folders import CampaignFolders
from tests.fuzz.targets.control import Control, Page, Replies
from tests.fuzz.targets.epuck2 import Commands as Epuck2Commands
from tests.fuzz.targets.epuck2 import Sensed as Epuck2Answers
from tests.fuzz.targets.join import Given, Join, Offered
from tests.fuzz.targets.measured import RadioLogs, RobotLogs, Traces
from tests.fuzz.targets.observed import Glimpses, Scenes
from tests.fuzz.targets.radio import Poses, Questions, Radio
from tests.fuzz.targets.ros2 import Commanded, Told
from tests.fuzz.targets.run_folders import RunFolders
from tests.fuzz.targets.runner_frames import RunnerFrames
from tests.fuzz.targets.scenarios import Bodies, Campaigns, Scenarios
from tests.fuzz.targets.settings import Certificates, Fleets, Settings
from tests.fuzz.targets.world_frames import WorldFrames

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
