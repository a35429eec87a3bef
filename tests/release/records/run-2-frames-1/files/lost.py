import os, signal
from swarmwire.agent import Agent
class Lost(Agent):
    def step(self, robot):
        if robot.time_s > 0.35 and os.environ.get("LOSE") and robot.draw.uniform("x") >= 0:
            os.kill(os.getpid(), signal.SIGKILL)
        robot.drive(linear_mps=0.05, angular_radps=0.0)
