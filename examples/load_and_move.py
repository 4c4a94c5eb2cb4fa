"""Load a robot, close its loops, and move it to commands and back."""

import numpy as np

import gtpin

print("shipped:", ", ".join(gtpin.robot_names()))
robot = gtpin.load_robot("gantry_tau")  # or the path of a URDF with <loop_joint>s
print(f"{robot.name}: actuators {robot.sites}, rods {robot.rod_sites}")
print(f"range of its commands: {robot.lower} to {robot.upper} m")

posture = robot.forward([0.10, -0.05, 0.20])  # commands of the carts, m; all loops are closed
print("TCP", posture.T, "m")
print("orientation", *np.round(posture.R, 6), sep="\n  ")

back = robot.inverse(posture.T)  # inverse kinematics; the orientation follows
print("commands that bring the TCP there:", back)
assert np.abs(back - posture.q).max() < 1e-9
print("the TCP's motion per metre of each cart", robot.jacobian(back).round(3), sep="\n")

rng = np.random.default_rng(0)  # many at once, in arrays
q = rng.uniform(robot.lower, robot.upper, (20_000, 3))
poses = robot.forward(q)
print(f"{len(q)} poses; the TCP fills {np.ptp(poses.T, axis=0).round(2)} m")

forces = gtpin.static_forces(posture, payload=10.0)  # 10 kg at the TCP
for rod, force in zip(robot.rod_sites, forces.rods, strict=True):
    print(f"{rod:8} {force:8.1f} N")  # tension positive

try:
    robot.forward([-2.0, 0.0, 2.0])
except gtpin.GtpinError as error:
    print("not reachable:", error)
