# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``simulator``: an IMU on a moving body, live.

Samples come from :mod:`imu_sim_ros.simulation.engine`, are turned into the bytes of messages
block by block, and are published by a thread of their own on absolute deadlines of the steady
clock. rclpy's executor keeps parameters, services and diagnostics in the main thread.

The node is a plain one with ``autostart``, not a managed one: a VIO stack's launch file expects a
driver that streams once it runs, and ``autostart: false`` with ``~/pause`` gives the same control
over the first sample without five more services at every start.
"""

import sys
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from std_srvs.srv import SetBool, Trigger

from imu_sim_ros.bags.messages.encode import CLOCK, ClockEncoder
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.core import conventions, timebase
from imu_sim_ros.core.errors import ConfigurationError, MissingDependencyError
from imu_sim_ros.core.records import States
from imu_sim_ros.nodes import run, sensor_description, signals
from imu_sim_ros.nodes.diagnostics import PERIOD, drawn_constants, fault_message
from imu_sim_ros.nodes.messages import message_class
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.nodes.publishing import Counter, check_overrides, create
from imu_sim_ros.nodes.simulator import transforms
from imu_sim_ros.nodes.simulator.apart import SensorsApart
from imu_sim_ros.nodes.simulator.diagnostics import Histogram, StreamReport
from imu_sim_ros.nodes.simulator.engine import Engine
from imu_sim_ros.nodes.simulator.pacing import Pacer, RosClockPacer, Settling, Stall
from imu_sim_ros.nodes.simulator.publish_queue import (
    BodyStream,
    PublishQueue,
    Send,
    Stream,
    TickStream,
)
from imu_sim_ros.nodes.simulator.serial_line import PseudoTerminal, messages
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.declaration import Topic
from imu_sim_ros.simulation import topics
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import DEFAULT_TRAJECTORY, imus, layer_files
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.simulation.sensors import mount_sensors, mounts
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.parameters import DriveParameters, PosesParameters

if TYPE_CHECKING:
    from imu_sim_ros.nodes.simulator.apart import RemoteCounter, SensorsApart

QUEUE: Final = 4000
"""Messages kept for a reliable subscriber that has not acknowledged them: 2 s at 2 kHz."""

_SWITCH_INTERVAL: Final = 1e-4
"""Python's switch interval; its default of 5 ms would make 10 samples late [s]."""
_ACKNOWLEDGEMENT: Final = Duration(nanoseconds=50_000_000)
_STEP_TIMEOUT: Final = 5.0
"""Longest time of the service ``step`` [s]."""
_STALL_PERIOD: Final = 10.0
"""Time between two warnings of stalls, which are frequent on a slow machine [s]."""


class Simulator(ConfiguredNode[SimulatorParameters]):
    """Publishes the samples of a simulation when they are due; services pause, step, reset it."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__("simulator", SimulatorParameters, layer_files, **arguments)
        self._counters: list[Counter | RemoteCounter] = []
        """Publishers of samples, which count their messages."""
        self._terminals: list[PseudoTerminal] = []
        """Serial lines of sensors."""
        self._lateness = Histogram()
        self._drawn_of: SimulatorParameters | None = None
        """Parameters that ``_drawn_values`` belongs to."""
        self._drawn_values: Mapping[str, str] = {}
        """Errors drawn by the seeds, for the diagnostics."""
        self._stalls: list[Stall] = []
        """Stalls since the last warning."""
        self._stalls_reported = -_STALL_PERIOD
        """Time of the last warning of stalls, on the steady clock [s]."""
        self._remarks: list[str] = []
        """Warnings about the parameters, logged at the end of the set-up."""
        self._notes: list[str] = []
        """Choices of the set-up, logged at its end."""
        self._settling = Settling()
        self._follows = bool(self.get_parameter("use_sim_time").value)
        """True if time comes from an external ``/clock``."""
        parameters = self.parameters
        self._check_clocks(parameters)
        self._faults = create(
            self,
            DiagnosticArray,
            conventions.FAULTS_TOPIC,
            QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        )
        self._diagnostics = create(self, DiagnosticArray, "/diagnostics", QoSProfile(depth=10))
        # Started first: these processes load while the rest is set up.
        self._apart = self._start_sensor_processes(parameters)
        outputs = [*self._outputs(parameters), *(self._apart.outputs if self._apart else ())]
        self._body = Body(parameters, _read_poses, sensors={name for name, *_ in outputs})
        self._remarks += self._body.warnings(elsewhere=True)
        self._notes += self._body.notes(elsewhere=True)
        self._descriptions = self._describe(parameters)
        streams = [
            BodyStream(self._body, outputs),
            *self._transform_streams(parameters, self._body.trajectory),
            *self._clock_streams(parameters.publish.clock_rate),
        ]
        if parameters.publish.tf_static:
            self._publish_mounts(parameters)
        # All topics exist now: an override that names none of them is a mistake.
        check_overrides(self, self._apart.topics if self._apart else ())
        self.engine = self._create_engine(parameters, streams)
        self._fresh = not parameters.autostart
        """True until the run is started for the first time."""
        self.engine.pacer.pause(self._fresh)
        if parameters.inject.kind != "none":
            self._inject(parameters)
        self._create_services()
        self._log_set_up(parameters)
        sys.setswitchinterval(_SWITCH_INTERVAL)
        self.engine.start()

    def close(self) -> None:
        """End the threads, and print how much was published, and how late."""
        self.engine.stop()
        self._report_stalls(0.0)
        self._lateness.add(self.engine.pacer.take_lateness())
        if self._lateness.maximum_ns:
            print(
                f"simulator: lateness p50 {self._lateness.quantile_us(0.5):.0f} us, "
                f"p99 {self._lateness.quantile_us(0.99):.0f} us, "
                f"max {self._lateness.maximum_ns * 1e-3:.0f} us"
            )
        if self._apart is not None:
            self._apart.close()
        for terminal in self._terminals:
            terminal.close()
            lost = f", {terminal.lost} lost: the reader was too slow" if terminal.lost else ""
            print(f"simulator: wrote {terminal.written} messages to {terminal.name}{lost}")
        for counter in self._counters:
            print(f"simulator: published {counter.count} messages on {counter.topic}", flush=True)

    # ------------------------------------------------------------------------- set-up
    def _check_clocks(self, parameters: SimulatorParameters) -> None:
        """Refuse a simulator that both follows and publishes the clock."""
        if self._follows and parameters.publish.clock_rate:
            raise ConfigurationError(
                f"publish.clock_rate = {parameters.publish.clock_rate:g}: must be 0 if "
                "use_sim_time is true; time comes from an external /clock"
            )
        if self._follows and parameters.real_time_factor != 1.0:
            raise ConfigurationError(
                f"real_time_factor = {parameters.real_time_factor:g}: must be 1 if use_sim_time "
                "is true; time comes from an external /clock"
            )

    def _outputs(self, parameters: SimulatorParameters) -> list[tuple[str, topics.Encode, Send]]:
        """Return the sensor, encoder and receiver of each topic and serial line that there is."""
        outputs: list[tuple[str, topics.Encode, Send]] = []
        sensors = mount_sensors(parameters)
        for name, offer in topics.published_topics(sensors, parameters.publish).items():
            if not offer.mounted.sensor.apart and self._can_publish(offer.topic):
                publisher = self._counting_publisher(name, offer.topic.type)
                outputs.append((offer.name, offer.encoder(), publisher))
        for name, sensor in sensors.items():
            serial = sensor.sensor.serial
            if serial and (where := serial.where(sensor.parameters)):
                terminal = PseudoTerminal(where)
                self._terminals.append(terminal)
                self._notes.append(f"{name}: serial line on {terminal.name}")
                outputs.append((name, messages(serial), terminal.send))
        return outputs

    def _create_engine(self, parameters: SimulatorParameters, streams: Sequence[Stream]) -> Engine:
        """Return the engine that publishes streams in the order of time until the run ends."""
        return Engine(
            PublishQueue(streams, parameters.duration or self._body.trajectory.duration),
            self._pacer(parameters),
            parameters.block_duration,
            ready=self._is_ready,
            zero=self._zero,
            acknowledged=self._wait_for_acknowledgement,
            on_end=self.lifetime.finish,
            fail=self.lifetime.fail,
        )

    def _log_set_up(self, parameters: SimulatorParameters) -> None:
        """Log the warnings and notes of the set-up, and a summary of the simulation."""
        for line in dict.fromkeys(self._remarks):
            self.get_logger().warning(line)
        for line in self._notes:
            self.get_logger().info(line)
        self.get_logger().info(self._summary(parameters))

    def _can_publish(self, topic: Topic) -> bool:
        """Return whether a topic's type is installed, if it need not be."""
        if topic.foreign:
            try:
                message_class(topic.type)
            except MissingDependencyError as error:
                self._notes.append(f"{topic.name} is not published: {error}")
                return False
        return True

    def _describe(self, parameters: SimulatorParameters) -> dict[str, Publisher]:
        """Return the publisher of the description of each IMU, which it has published."""
        publishers = {}
        for name, simulated in imus(parameters).items():
            publishers[name] = sensor_description.create_publisher(self, f"{name}/" if name else "")
            sensor_description.publish(publishers[name], simulated)
        return publishers

    def _start_sensor_processes(self, parameters: SimulatorParameters) -> "SensorsApart | None":
        """Return the sensors with processes of their own; None, if there are none."""
        if not any(sensor.sensor.apart for sensor in mount_sensors(parameters).values()):
            return None

        apart = SensorsApart(self, parameters, self.lifetime.fail)
        self._counters += apart.counters
        return apart

    def _transform_streams(
        self, parameters: SimulatorParameters, trajectory: Trajectory
    ) -> list[Stream]:
        """Return the stream of transforms, if it is wanted."""
        rate = parameters.publish.tf_rate
        if not rate:
            return []
        send = self._counting_publisher(conventions.TF_TOPIC, TF_MESSAGE, transforms.QOS)
        return [transforms.transform_stream(rate, parameters, trajectory, send)]

    def _clock_streams(self, rate: float) -> list[Stream]:
        """Return the stream of ``/clock``; empty: the rate is 0.

        :param rate: messages per second of simulated time [Hz].
        """
        if not rate:
            return []
        encoder, send = ClockEncoder(), self._counting_publisher("/clock", CLOCK)
        return [TickStream(rate, lambda t, _: [row.tobytes() for row in encoder.encode(t)], send)]

    def _publish_mounts(self, parameters: SimulatorParameters) -> None:
        """Publish the mounts of the sensors as fixed transforms."""
        sensors = mounts(mount_sensors(parameters))
        t_ns = int(self.get_clock().now().nanoseconds)
        try:
            # Kept: later subscribers get it from the publisher.
            self._mounts = transforms.publish_mounts(self, sensors, t_ns)
        except MissingDependencyError as error:
            if "publish.tf_static" in self.overrides:
                raise
            self._notes.append(f"/tf_static is not published: {error}")

    def _counting_publisher(
        self, topic: str, type_name: str, qos: QoSProfile | None = None
    ) -> Send:
        """Return the function that publishes on a new topic and counts the messages."""
        publisher = create(self, type_name, topic, qos or QoSProfile(depth=QUEUE))
        counter = Counter(topic, publisher)
        self._counters.append(counter)
        return counter.send

    def _pacer(self, parameters: SimulatorParameters) -> Pacer:
        """Return the pacer: by the steady clock, or by the time that others publish."""
        if not self._follows:
            return Pacer(parameters.real_time_factor, parameters.catch_up, self._after_stall)
        clock = self.get_clock()
        pacer = RosClockPacer(
            lambda: clock.now().nanoseconds, parameters.catch_up, self._after_stall
        )

        def moved(jump: TimeJump) -> None:
            if jump.delta.nanoseconds < 0:
                self.get_logger().warning("the clock jumped back: starting over")
                self.engine.reset()
            pacer.tick()

        self._jumps = clock.create_jump_callback(
            JumpThreshold(
                min_forward=Duration(nanoseconds=1),
                min_backward=Duration(nanoseconds=-1),
                on_clock_change=True,
            ),
            post_callback=moved,
        )
        return pacer

    def _create_services(self) -> None:
        """Create the services pause, reset and step."""
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self._stepping = False
        # While it awaits the samples, the callbacks of the node's own group keep running.
        group = ReentrantCallbackGroup()
        self.create_service(Trigger, "~/step", self._on_step, callback_group=group)
        hardware = f"simulated, {self.parameters.imu.preset}, seed {self.parameters.seed}"
        self._report = StreamReport(f"{self.get_name()}: stream", hardware)
        self._reported = time.monotonic()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(PERIOD, self._diagnose, clock=steady)

    def _summary(self, parameters: SimulatorParameters) -> str:
        """Return a line about the simulation: IMUs, cameras, trajectory."""
        described = ", ".join(
            f"{name + ': ' if name else ''}{p.imu.preset} at {p.rate:g} Hz, seed {p.seed}"
            for name, p in imus(parameters).items()
        )
        cameras = f"; cameras {', '.join(parameters.cameras)}" if parameters.cameras else ""
        trajectory = parameters.trajectory
        file = trajectory.file if isinstance(trajectory, PosesParameters | DriveParameters) else ""
        motion = file or self.overrides.get("trajectory.type", DEFAULT_TRAJECTORY)
        return f"{described}; trajectory {motion}{cameras}"

    # ------------------------------------------------------------------------- the run
    def _is_ready(self) -> bool:
        """Return whether all expected subscribers are there; called repeatedly."""
        if self._follows and self.get_clock().now().nanoseconds == 0:
            return False
        if self._apart is not None and not self._apart.ready:
            return False
        minimums = {
            conventions.IMU_TOPIC: self.parameters.wait_for_subscribers,
            conventions.TRUTH_TOPIC: self.parameters.wait_for_truth_subscribers,
        }
        missing = False
        for counter in self._counters:
            for topic, count in minimums.items():
                if counter.topic.endswith(topic):
                    missing |= counter.publisher.get_subscription_count() < count
        if missing or not any(minimums.values()):
            return not missing
        if self._apart is not None and not self._apart.is_connected(time.monotonic()):
            return False
        counts = [counter.publisher.get_subscription_count() for counter in self._counters]
        return self._settling.has_settled(counts, time.monotonic())

    def _zero(self, lead_ns: int) -> int:
        """Return the time of the first sample [ns], which is due after a lead [ns]."""
        if self.parameters.start_time >= 0:
            return timebase.to_nanoseconds(self.parameters.start_time)
        if self._follows:
            return int(self.get_clock().now().nanoseconds)
        return time.time_ns() + lead_ns

    def _wait_for_acknowledgement(self) -> bool:
        """Return True if subscribers have acknowledged all messages in time."""
        return all(
            counter.publisher.wait_for_all_acked(_ACKNOWLEDGEMENT) for counter in self._counters
        )

    def _after_stall(self, stall: Stall) -> None:
        """Note that samples were late, and tell it now and then."""
        self._stalls.append(stall)
        self._report_stalls(_STALL_PERIOD)

    def _report_stalls(self, period: float) -> None:
        """Warn of the stalls so far, at most once in a period [s]."""
        time_s = time.monotonic()
        if not self._stalls or time_s - self._stalls_reported < period:
            return
        self._stalls_reported = time_s
        stalls, self._stalls = self._stalls, []
        longest = max(stall.late_ns for stall in stalls) * 1e-9
        samples = sum(stall.samples for stall in stalls)
        often = "" if len(stalls) == 1 else f" {len(stalls)} times,"
        skipped = any(stall.skipped for stall in stalls)
        self.get_logger().warning(
            f"publishing stalled{often} for {'' if not often else 'up to '}{longest:.3f} s: "
            f"{samples} samples {'skipped' if skipped else 'published late, none lost'}"
        )

    # ------------------------------------------------------------------------- control
    def apply(self, parameters: SimulatorParameters) -> None:
        """Apply new parameters with the next block.

        :raises ConfigurationError: for an invalid fault.
        """
        if self._follows and parameters.real_time_factor != 1.0:
            raise ConfigurationError("real_time_factor: must be 1 if use_sim_time is true")
        if "inject.kind" in self.changed and parameters.inject.kind != "none":
            self._inject(parameters)
        self.engine.pacer.configure(parameters.real_time_factor, parameters.catch_up)
        if any(name.partition(".")[0] not in _OF_THE_NODE for name in self.changed):
            self.engine.change(lambda: self._body.update(parameters))
            for name, simulated in imus(parameters).items():
                sensor_description.publish(self._descriptions[name], simulated)

    def _inject(self, parameters: SimulatorParameters) -> None:
        """Start the requested fault with the next block.

        :raises ConfigurationError: for one that cannot be, and a sensor that is not published.
        """
        injection = parameters.inject
        for sensor in sensors_of_imus():
            if sensor.name == injection.triad and not flatten(parameters.publish)[sensor.quantity]:
                raise ConfigurationError(
                    f"inject.triad = {injection.triad}: needs publish.{sensor.quantity}, which is "
                    "false"
                )
        fault = injection.fault()

        def begin() -> None:
            for imu, t_ns in self._body.inject(fault, injection.delay, injection.imu).items():
                stamp = Time(nanoseconds=t_ns).to_msg()
                self._faults.publish(fault_message(f"{self.get_name()}: fault", fault, imu, stamp))

        self.engine.change(begin)

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        """Pause or resume, for the service."""
        if self._fresh and not request.data:
            # Nothing was published yet: time zero is now, not when the node was started.
            self._fresh = False
            self.engine.reset()
        self.engine.pacer.pause(request.data)
        response.success = True
        response.message = "paused" if request.data else "running"
        return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Restart with the first sample, for the service."""
        self.engine.reset()
        response.success, response.message = True, "back at the first sample"
        return response

    async def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Step in a thread that waits for the samples; everything else goes on meanwhile."""
        pacer, count = self.engine.pacer, self.parameters.step_samples
        refusal = (
            "not paused: call ~/pause with true first"
            if not pacer.paused
            else "a step is in progress"
            if self._stepping
            else ""
        )
        if refusal:
            response.success, response.message = False, refusal
            return response
        self._fresh, self._stepping = False, True
        passed = await self.lifetime.in_thread("step", lambda: pacer.step(count, _STEP_TIMEOUT))
        self._stepping = False
        response.success = passed == count
        response.message = f"{count} samples"
        if passed < count:
            response.message = f"{passed} of {count} samples in {_STEP_TIMEOUT:g} s"
            if not self.engine.started:
                response.message += ": still waiting to start"
        return response

    def _diagnose(self) -> None:
        """Publish rates, lateness and counts as diagnostics."""
        self._report_stalls(_STALL_PERIOD)
        time_s = time.monotonic()
        elapsed, self._reported = time_s - self._reported, time_s
        pacer = self.engine.pacer
        lateness_ns = pacer.take_lateness()
        self._lateness.add(lateness_ns)
        state = "paused" if pacer.paused else "running" if self.engine.started else "waiting"
        late = {"caught up": pacer.caught_up, "skipped": pacer.skipped}
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(
            self._report.message(
                stamp, elapsed, state, self._counters, lateness_ns, late, self._drawn_constants()
            )
        )

    def _drawn_constants(self) -> Mapping[str, str]:
        """Return the errors drawn by the seeds; computed again after a change of parameters."""
        if self._drawn_of is not self.parameters:
            self._drawn_of = self.parameters
            self._drawn_values = drawn_constants(imus(self.parameters))
        return self._drawn_values


_OF_THE_NODE: Final = ("inject", "real_time_factor", "catch_up", "step_samples")


def _read_poses(path: str, topic: str | None = None) -> States:
    """Return the poses of a file of any format."""
    from imu_sim_ros.formats.door import (
        read_states,
    )  # readers of all bags, which few trajectories need

    return read_states(path, topic)


def main() -> int:
    """Run the node."""
    return run.main("simulator", Simulator)


if __name__ == "__main__":
    signals.watch(is_final=True)
    sys.exit(main())
