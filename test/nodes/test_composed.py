# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Several nodes in one process, and several of one kind in a graph."""

from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Imu

from imu_sim_ros.nodes.integrator.node import Integrator
from imu_sim_ros.nodes.simulator.node import Simulator
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation


def gyro(messages: list[Any]) -> np.ndarray:
    return np.array([[getattr(m.angular_velocity, axis) for axis in "xyz"] for m in messages])


def _seeds(listener: Any) -> dict[int, dict[str, str]]:
    """Return the latest diagnostics by the seed that they state."""
    stated = {}
    for message in listener.messages("/diagnostics"):
        values = {v.key: v.value for v in message.status[0].values}
        stated[int(values["seed"])] = values
    return stated


def test_two_simulators_have_two_seeds_and_say_which(start: Any, listener: Any) -> None:
    """Default seeds differ; the seed in a node's diagnostics reproduces its readings offline."""
    chosen = {"rate": 100, "imu__preset": "bmi088", "trajectory__type": "static", "start_time": 1}
    ready = {"wait_for_subscribers": 1}
    spaces = ("left", "right", "")
    for name in spaces:
        listener.listen(f"{'/' if name else ''}{name}/imu/data_raw", Imu)
    listener.listen("/diagnostics", DiagnosticArray)
    for name in spaces:
        extra = ["--ros-args", "-r", f"__ns:=/{name}"] if name else []
        start("simulator", *extra, **chosen, **ready)
    for name in spaces:
        listener.wait_for(f"{'/' if name else ''}{name}/imu/data_raw", 250)
    listener.wait_until(lambda: len(_seeds(listener)) == 3, "diagnostics of three simulators")
    stated = _seeds(listener)
    assert 0 in stated
    offline = {}
    for seed, values in stated.items():
        parameters = load_simulation(
            {key.replace("__", "."): value for key, value in chosen.items()} | {"seed": seed}
        )
        offline[seed] = Body(parameters).next(250)["imu"].gyro
        drawn = realise_imu(parameters.imu, seed).gyroscope.bias
        np.testing.assert_allclose(
            [float(word) for word in values["imu.gyroscope_bias"].split()], drawn, rtol=1e-8
        )
    for name in spaces:
        live_gyro = gyro(listener.messages(f"{'/' if name else ''}{name}/imu/data_raw"))[:250]
        matching_seeds = [
            seed for seed, expected in offline.items() if np.array_equal(expected, live_gyro)
        ]
        assert len(matching_seeds) == 1
        assert (matching_seeds == [0]) == (name == "")
        del offline[matching_seeds[0]]


def test_a_parameter_of_one_node_of_a_process_is_none_of_the_others(listener: Any, capfd: Any):
    """``-p seed:=3`` of a composed process is given to both; a name of none is refused."""
    context = rclpy.Context()
    arguments = ["--ros-args", "-p", "seed:=3", "-p", "publish.clock_rate:=0.0"]
    rclpy.init(args=arguments, context=context, domain_id=listener.context.get_domain_id())
    nodes = [Integrator(context=context), Simulator(context=context)]
    try:
        assert nodes[1].parameters.seed == 3
        error_text = capfd.readouterr().err
        assert "seed: is a parameter of another node; no effect here" in error_text
    finally:
        for node in nodes:
            node.close()
            node.destroy_node()
        context.try_shutdown()


def test_two_nodes_of_a_process_with_one_seed_say_so(listener: Any, capfd: Any) -> None:
    """``-p seed:=3`` of a composed process gave both the same noise without a word."""
    context = rclpy.Context()
    arguments = ["--ros-args", "-p", "seed:=3", "-p", "autostart:=false"]
    rclpy.init(args=arguments, context=context, domain_id=listener.context.get_domain_id())
    warning_text = "seed = 3: /left/simulator in this process has it, too"

    def warned(spaces: tuple[str, ...], **node_options: Any) -> bool:
        nodes = [Simulator(context=context, namespace=space, **node_options) for space in spaces]
        for node in nodes:
            node.close()
            node.destroy_node()
        return warning_text in capfd.readouterr().err

    try:
        assert warned(("left", "right"))
        assert not warned(("left",))  # the others are gone
        assert not warned(("left", "right"), use_global_arguments=False)  # each has its own
    finally:
        context.try_shutdown()


def test_a_name_that_no_node_has_is_still_refused(start: Any, listener: Any) -> None:
    node = start("integrator", "--ros-args", "-p", "sed:=3")
    assert listener.wait_for_end(node) == 2
    assert "sed: unknown parameter" in node.output
    node = start("integrator", "--seed", "3")
    assert listener.wait_for_end(node) == 2
    assert "seed: unknown parameter" in node.output
