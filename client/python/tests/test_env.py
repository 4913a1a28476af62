"""Lockstep: the same actions give the same bits, whatever the program and the network do meanwhile."""

import time
import unittest

import numpy as np
import scindo
from common import PATIENCE, block

START = (0.06, 0.03, 0.06)
ACTIONS = [(0.06, 0.03, 0.0462 - 0.0006 * i) for i in range(12)]


def episode(env, pause_s=0.0):
    """Bytes of all observations, and the last force."""
    observation, info = env.reset(seed=1, options={"position": START})
    assert info["step"] == 0 and observation["time_s"] == 0.0
    seen = [observation["positions"].tobytes()]
    for action in ACTIONS:
        time.sleep(pause_s)
        observation, _, _, _, info = env.step(action)
        seen.append(observation["positions"].tobytes() + observation["tool_force"].tobytes())
    return seen, observation


class Lockstep(unittest.TestCase):
    def test_episodes_repeat_to_the_bit(self):
        seen = []
        for threads in (1, 2):
            with scindo.serve(block(), threads=threads) as server, server.connect(timeout=PATIENCE) as session:
                env = scindo.Env(session, "finger", "block")
                for pause_s in (0.0, 0.03):
                    bits, last = episode(env, pause_s)
                    seen.append(bits)
                self.assertGreater(last["tool_force"][2], 0.1)
                self.assertAlmostEqual(last["time_s"], 0.12)
        for other in seen[1:]:
            self.assertEqual([a == b for a, b in zip(seen[0], other)], [True] * (len(ACTIONS) + 1))

    def test_rewards_and_ends(self):
        with scindo.serve(block()) as server, server.connect(timeout=PATIENCE) as session:
            env = scindo.Env(
                session,
                "finger",
                steps=3,
                reward=lambda seen, action: -abs(seen["tool_force"][2] - 1.0),
                terminated=lambda seen: seen["tool_force"][2] > 0.05,
                max_steps=4,
            )
            self.assertRaises(scindo.InvalidValue, env.step, START)
            observation, _ = env.reset()
            self.assertGreater(observation["tool_position"][2], 0.1)
            pose = np.array([*START, 0.0, 0.0, 0.0, 1.0])
            observation, reward, terminated, truncated, info = env.step(pose)
            self.assertEqual((reward, terminated, truncated, info["step"]), (-1.0, False, False, 3))
            env.step({"position": (0.06, 0.03, 0.046), "mode": "hover"})
            env.step((0.06, 0.03, 0.045))
            observation, reward, terminated, truncated, info = env.step((0.06, 0.03, 0.042))
            self.assertTrue(terminated and truncated, observation)
            self.assertGreater(reward, -1.0)
            self.assertEqual(session.body("block").surface.step, 12)
            self.assertRaises(scindo.InvalidValue, env.step, (1.0, 2.0))
            env.close()
            self.assertFalse(session.stats(wait=True).paused)
            self.assertEqual(session.tools["finger"], "")


if __name__ == "__main__":
    unittest.main()
