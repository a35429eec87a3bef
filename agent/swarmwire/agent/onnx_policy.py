"""OnnxPolicy: a VectorAgent that runs a trained policy from an .onnx file; and `save_policy`, which writes such a file.

A scenario, or the settings of a robot, name the file as the agent: `agent = "flocking.onnx"`. The file has the network,
and in its metadata the policy's inputs and outputs, so it needs no other file.
"""

import hashlib
import json
import sys
import threading
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.policy_io import Float32Array, PolicyIO, PolicyLayout
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.base.atomic import output_file
from swarmwire.comms.base.config import check_format, converted, from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import POLICY
from swarmwire.comms.robot.bodies.body import Body

METADATA = "swarmwire.policy"  # key in the file's metadata
METADATA_PROPS, KEY, VALUE = 14, 1, 2  # fields of ONNX's messages ModelProto and StringStringEntryProto
FORMAT = 1  # format of the metadata
ROWS = 16  # rows in a call: more would cost a single robot more, and many robots hardly less
POLICY_NAME = "OnnxPolicy"  # name of the class in the module of its file
TRIAL_S = 60.0  # limit for the first actions of a network
EXTERNAL_FOLDER = "session.model_external_initializers_file_folder_path"
NO_FOLDER = "/dev/null"  # no file is below it; by default onnxruntime reads weights in the working folder
FATAL = 4  # severity of a line of onnxruntime's log; its errors are raised anyway


@dataclass(frozen=True)
class About:
    """The metadata of a policy's file."""

    io: PolicyIO
    observation: tuple[str, ...]  # the name of each number
    action: tuple[str, ...]


class PolicyNetwork:
    """A network in onnxruntime, on one core, whose action for a robot does not depend on others in its process.

    A product of matrices may have other last bits with another number of rows, and so in another layout of processes.
    Every call therefore has `ROWS` rows, padded with 0, if a trial shows that a row gives the same bits at each index
    of a block, alone and among others. If it does not, or the network accepts one row only, each robot is a call.

    Attributes:
        sizes: lengths of an observation and of an action.
        metadata: metadata of the file.
    """

    def __init__(self, model: bytes, where: str) -> None:
        """Load the model; BadInput at `where` unless it maps one float32 (rows, numbers) to another."""
        POLICY.need(where)
        import onnxruntime

        ort: Any = onnxruntime  # the package has no types
        options = ort.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = FATAL
        options.add_session_config_entry(EXTERNAL_FOLDER, NO_FOLDER)  # the file's digest must cover all weights
        try:
            self._session: Any = ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors have no narrower base
            raise BadInput(where, "", f"onnxruntime does not load it: {_line(error)}") from error
        ends = self._session.get_inputs(), self._session.get_outputs()
        for side, tensors in zip(("input", "output"), ends, strict=True):
            if len(tensors) != 1 or tensors[0].type != "tensor(float)" or len(tensors[0].shape) != 2:
                raise BadInput(where, "", f"expected one {side}, float32 (rows, numbers)")
            rows, numbers = tensors[0].shape
            if not isinstance(numbers, int) or (isinstance(rows, int) and rows != 1):
                expected = f"expected an {side} with any number of rows, or one, and a fixed number of numbers"
                raise BadInput(where, "", f"{expected}; got {rows} x {numbers}")
        (self._input,), (output,) = ends
        self.sizes = self._input.shape[1], output.shape[1]
        self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        self._where, self._options = where, ort.RunOptions()

    @cached_property
    def rows(self) -> int:
        """Number of rows in a call: `ROWS` or 1."""
        return ROWS if self._input.shape[0] != 1 and self._rows_are_independent() else 1

    def try_out(self) -> None:
        """Run the network once; BadInput if it fails or takes longer than `TRIAL_S`, like an endless loop."""
        timer = threading.Timer(TRIAL_S, setattr, (self._options, "terminate", True))
        timer.daemon = True
        timer.start()
        try:
            self(np.zeros((1, self.sizes[0]), np.float32))
        except Exception as error:  # onnxruntime's errors have no narrower base
            fault = f"no action within {TRIAL_S:g} s" if self._options.terminate else _line(error)
            raise BadInput(self._where, "", f"expected a network that runs: {fault}") from error
        finally:
            timer.cancel()

    def __call__(self, observation: Float32Array) -> Float32Array:
        """Return the action of each row, (n, numbers)."""
        n, rows = len(observation), self.rows
        padded = np.zeros((-(-n // rows) * rows, observation.shape[1]), np.float32)
        padded[:n] = observation
        blocks = [self._run(padded[start : start + rows]) for start in range(0, len(padded), rows)]
        return np.concatenate(blocks)[:n]

    def _run(self, block: Float32Array) -> Float32Array:
        action: Float32Array = self._session.run(None, {self._input.name: block}, self._options)[0]
        if action.shape != (len(block), self.sizes[1]):
            raise ValueError(f"expected an output of {len(block)} x {self.sizes[1]}, got shape {action.shape}")
        return action

    def _rows_are_independent(self) -> bool:
        """Return True if a row has the same action, bit for bit, alone at each index of a block and among others."""
        block = np.sin(np.arange(ROWS * self.sizes[0], dtype=np.float32)).reshape(ROWS, self.sizes[0])
        together = self._run(block)
        for row in range(ROWS):
            for index in range(ROWS):
                alone = np.zeros_like(block)
                alone[index] = block[row]
                if not np.array_equal(self._run(alone)[index], together[row]):
                    return False
        return True


class OnnxPolicy(VectorAgent):
    """Runs the policy of an .onnx file: observes, runs the network, drives and sends.

    A policy sees one step at a time and has no memory. It should act at the rate of its training.
    """

    network: ClassVar[PolicyNetwork]
    about: ClassVar[About]

    def __init__(self) -> None:
        self._layouts: list[PolicyLayout] = []  # the layout, after the first step

    @classmethod
    def check_body(cls, body: Body) -> None:
        """Check that the policy's numbers are those of this body; ValueError names the first that differs."""
        layout = PolicyLayout(cls.about.io, body)
        for side in ("observation", "action"):
            trained_names, names = getattr(cls.about, side), getattr(layout, side)
            for index, (trained, name) in enumerate(zip_longest(trained_names, names, fillvalue="nothing")):
                if trained != name:
                    raise ValueError(
                        f"{cls.__name__} was trained for another body than {body.name}: number {index} of "
                        f"{len(trained_names)} of its {side} is {trained!r}, here {name!r}"
                    )

    def step(self, robots: Robots, memory: Memory) -> None:
        """Observe, run the network and act."""
        if not self._layouts:
            self._layouts.append(PolicyLayout(self.about.io, robots.body))
        layout = self._layouts[0]
        layout.act(robots, self.network(layout.observe(robots)))


def policy_class(path: Path) -> type[OnnxPolicy]:
    """Return the agent class of a file, made once for its content; BadInput if the file has no policy."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    module_name = f"swarmwire_policy_{path.stem}_{hashlib.sha256(str(path).encode() + data).hexdigest()[:12]}"
    if module_name not in sys.modules:
        network = PolicyNetwork(data, str(path))
        about = _about(network, str(path))
        network.try_out()  # after the metadata, which limits the size of its input
        module = ModuleType(module_name)
        module.__file__ = str(path)  # `agent_sha256` and copies of a run find the file here
        members = {"network": network, "about": about, "needs": about.io.needs, "__module__": module_name}
        vars(module)[POLICY_NAME] = type(path.name, (OnnxPolicy,), {**members, "__doc__": OnnxPolicy.__doc__})
        sys.modules[module_name] = module
    return getattr(sys.modules[module_name], POLICY_NAME)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def _about(network: PolicyNetwork, where: str) -> About:
    if METADATA not in network.metadata:
        text = "has no description of its observations: expected a file of swarmwire.agent.onnx_policy.save_policy"
        raise BadInput(where, "", text)
    source = f"{where}, metadata {METADATA}"
    try:
        metadata = from_json(network.metadata[METADATA])
    except ValueError as error:
        raise BadInput(source, "", f"expected JSON: {error}") from error
    check_format(metadata, FORMAT, source)
    about = converted(About, metadata, source)
    sizes = len(about.observation), len(about.action)
    if network.sizes != sizes:
        raise BadInput(where, "", f"expected a network of {sizes[0]} numbers to {sizes[1]}, got {network.sizes}")
    return about


def save_policy(path: Path, model: bytes, layout: PolicyLayout) -> None:
    """Write a policy's file: an exported model with the layout of its inputs and outputs in its metadata.

    `model` is an ONNX model with its weights, from one float32 input (rows, numbers of an observation) to one float32
    output (rows, numbers of an action), for any number of rows. BadInput if it is not.
    """
    about = {"format": FORMAT, **asdict(About(layout.io, layout.observation, layout.action))}
    entry = _field(KEY, METADATA.encode()) + _field(VALUE, json.dumps(about).encode())
    data = model + _field(
        METADATA_PROPS, entry
    )  # protobuf reads concatenated messages as one, with the entries of both
    network = PolicyNetwork(data, str(path))
    _about(network, str(path))
    network.try_out()
    with output_file(path) as temporary:
        temporary.write_bytes(data)


def _field(number: int, content: bytes) -> bytes:
    """Encode a field of a protobuf message, with its length in front."""
    return bytes([number << 3 | 2]) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    """Encode an integer with seven bits a byte, the lowest first; the eighth bit means that more follow."""
    low, high = value & 0x7F, value >> 7
    return bytes([low | 0x80]) + _varint(high) if high else bytes([low])
