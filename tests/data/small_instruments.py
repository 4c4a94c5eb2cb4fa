"""A small valid dataset of schema 2 as text: an instrument of each kind."""

HEAD = """schema = "gtpin-dataset/2"
robot = "gantry_tau"
"""

TRACKER = """
[[instrument]]
name = "laser"
kind = "tracker"
position_sigma = 1.5e-5
orientation_sigma = 5e-5
"""
RANGE = """
[[instrument]]
name = "wire"
kind = "range"
sigma = 2e-5
stations = {A = [2.0, 0.1, 0.3], B = [-1.0, 2.0, 0.5]}
offset_sigma = 1e-3
targets = {T = [0.05, 0.0, -0.1], U = [0.0, 0.04, 0.0]}
"""
PLANE = """
[[instrument]]
name = "bed"
kind = "plane"
planes = {P = {point = [0.1, 0.2, -0.3], normal = [0.0, 0.1, 1.0]}, Q = {point = [0.0, 0.0, 0.3], normal = [1.0, 0.0, 0.0]}}
"""
SOCKET = """
[[instrument]]
name = "cup"
kind = "socket"
sockets = {S1 = [0.1, 0.2, 0.3]}
socket_sigma = 1e-3
distances = [["S1", "S2", 0.05, 5e-5]]
"""
TILT = """
[[instrument]]
name = "level"
kind = "tilt"
sigma = 5e-5
"""
ENCODER = """
[[instrument]]
name = "spare"
kind = "encoder"
joint = "leg1"
"""
TABLES = {
    "laser": "pose,q1,q2,q3,x,y,z,qw,qx,qy,qz,time\n"
    "a,0.1,0.2,0.3,1.5,-4.25,0.125,1,0,0,0,10\n"
    "b,-0.1,0.25,0.5,1.25,-4.5,0.25,0.6,0.8,0,0,20\n"
    "a,0.1,0.2,0.3,1.5,-4.25,0.125,1,0,0,0,40\n",
    "wire": "pose,q1,q2,q3,station,target,range,time\n"
    "a,0.1,0.2,0.3,A,T,1.25,10\n"
    "a,0.1,0.2,0.3,B,U,1.75,10\n"
    "c,0.3,0.2,0.3,B,T,1.5,30\n",
    "bed": "pose,q1,q2,q3,plane,height,time\nd,0.1,0.0,0.3,P,0.0,50\ne,0.1,0.0,0.2,Q,-1e-4,60\n",
    "cup": "pose,q1,q2,q3,socket,time\nf,0.1,0.1,0.1,S1,70\ng,0.2,0.1,0.1,S2,80\nh,0.2,0.2,0.1,S2,90\n",
    "level": "pose,q1,q2,q3,tilt_x,tilt_y,time\na,0.1,0.2,0.3,0.01,-0.02,10\nd,0.1,0.0,0.3,0.03,0.0,50\n",
    "spare": "pose,q1,q2,q3,reading,time\na,0.1,0.2,0.3,0.01,10\nd,0.1,0.0,0.3,0.03,50\n",
}
"""Tables by the name of the instrument."""
ALL = (TRACKER, RANGE, PLANE, SOCKET, TILT, ENCODER)
