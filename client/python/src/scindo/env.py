"""A server in lockstep with a program, in the manner of Gymnasium (which is not needed)."""

from __future__ import annotations

from typing import Any, Callable, Dict, Optional, Tuple

import numpy as np

from .errors import InvalidValue
from .session import Session

Observation = Dict[str, Any]


class Env:
    """Makes a fixed number of steps for each action, and waits for what comes of them.

        env = scindo.Env(session, tool="finger", body="block", max_steps=100)
        observation, info = env.reset(options={"position": (0.05, 0.03, 0.06)})
        observation, reward, terminated, truncated, info = env.step((0.05, 0.03, 0.039))

    The simulation stands still between actions, so results do not depend on the speed of the program or of the
    network: the same actions give the same bits. Surfaces come at ``publish.surface_hz`` of the scene, which limits
    the actions per second. The session must belong to an operator, and no other client may pause, step or reset.

    An action is a position [m], a pose (position and quaternion), or the arguments of :meth:`Tool.move` as a dict. An
    observation is a dict of ``time_s``, ``positions`` (n × 3 [m], of ``body``), ``tool_position`` [m], where the tissue
    allows the tool to be, and ``tool_force`` [N], that of the tissue on the tool.

    Args:
        session: a session with the server.
        tool: name of the tool that the actions move.
        body: name of the body that is observed; the first of the scene by default.
        steps: steps of the simulation per action.
        reward: reward of an observation after an action; 0 by default.
        terminated: whether an observation ends the episode.
        max_steps: actions after which an episode is truncated.
        timeout: longest wait for the results of an action [s].
    """

    def __init__(
        self,
        session: Session,
        tool: str,
        body: Optional[str] = None,
        *,
        steps: int = 1,
        reward: Optional[Callable[[Observation, Any], float]] = None,
        terminated: Optional[Callable[[Observation], bool]] = None,
        max_steps: Optional[int] = None,
        timeout: float = 30.0,
    ) -> None:
        if steps < 1:
            raise InvalidValue(f"steps = {steps} per action", hint="Make 1 or more")
        self.session, self.tool = session, session.tool(tool)
        self.body = session.body(body if body is not None else session.info.bodies[0].id)
        self._steps, self._reward, self._terminated = steps, reward, terminated
        self._max_steps, self._timeout = max_steps, timeout
        self._step: Optional[int] = None
        self._actions = 0

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None
    ) -> Tuple[Observation, Dict[str, Any]]:
        """Pauses, puts the tool at its place, and goes back to the start of the scene.

        Args:
            seed: accepted for programs that give one; a simulation has nothing random.
            options: ``position`` (and ``orientation``) of the tool at the start. It does not touch anything before the
                first action. Without them it starts above the body, far enough to be clear of it.
        """
        self.session.pause()
        start = dict(options or {})
        if "position" not in start:
            low, high = next((b.low, b.high) for b in self.session.info.bodies if b.id == self.body.id)
            start["position"] = 0.5 * (low + high) + self.session.info.up * float(np.linalg.norm(high - low))
        self.tool.move(**{**start, "mode": "hover"})
        # A step takes the tool there. The scene would start with it where the last episode left it, in the tissue.
        self.session.step(1, self._timeout)
        before = self.body.mirror.newest.count
        self.session.reset()
        self._step, self._actions = 0, 0
        surface = self.body.wait_exactly(0, self._timeout, before)
        observation = {
            "time_s": surface.time_s,
            "positions": surface.positions,
            "tool_position": np.asarray(start["position"], dtype=np.float64),
            "tool_force": np.zeros(3),
        }
        return observation, self._info()

    def step(self, action: Any) -> Tuple[Observation, float, bool, bool, Dict[str, Any]]:
        """Moves the tool, makes the steps, and observes.

        Returns:
            Observation, reward, whether the episode ended by itself, whether it was cut off, and details.
        """
        if self._step is None:
            raise InvalidValue("the environment has not been reset", hint="Call reset() before the first step()")
        self.tool.move(**_arguments(action))
        # Only what comes from now on counts: an earlier episode had a step of the same number.
        surfaces, states = self.body.mirror.newest.count, self.tool.states
        self.session.step(self._steps, self._timeout)
        self._step += self._steps
        self._actions += 1
        surface = self.body.wait_exactly(self._step, self._timeout, surfaces)
        state = self.tool.wait(self._step, self._timeout, states)
        observation = {
            "time_s": surface.time_s,
            "positions": surface.positions,
            "tool_position": state.allowed_position,
            "tool_force": state.force,
        }
        reward = 0.0 if self._reward is None else float(self._reward(observation, action))
        terminated = self._terminated is not None and bool(self._terminated(observation))
        truncated = self._max_steps is not None and self._actions >= self._max_steps
        return observation, reward, terminated, truncated, self._info()

    def close(self) -> None:
        """Frees the tool and lets the simulation run on."""
        if not self.session.link.closed:
            self.tool.release()
            self.session.resume()

    def _info(self) -> Dict[str, Any]:
        return {"step": self._step, "actions": self._actions}


def _arguments(action: Any) -> Dict[str, Any]:
    if isinstance(action, dict):
        return action
    array = np.asarray(action, dtype=np.float64)
    if array.shape == (3,):
        return {"position": array}
    if array.shape == (7,):
        return {"position": array[:3], "orientation": array[3:]}
    raise InvalidValue(
        f"the action has the shape {array.shape}",
        hint="Give a position (3 numbers), a pose (7), or a dict with the arguments of Tool.move",
    )
