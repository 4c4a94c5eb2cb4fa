"""Features of MJCF that move a body or change a mass: gtpin has MuJoCo's poses and masses, or says by name that it has not."""

from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.errors import GtpinWarning, RobotError
from gtpin.robot.description import RobotDescription

mujoco = pytest.importorskip("mujoco")

GEOM = '<geom size="0.05"/>'


def file(bodies: str, head: str = "", tail: str = "") -> str:
    return f"<mujoco>{head}<worldbody>{bodies}</worldbody>{tail}</mujoco>"


def arm(attributes: str = "", joint: str = "", inside: str = GEOM, head: str = "", tail: str = "") -> str:
    """An arm of two hinges: attributes of its second body and joint, and what is in this body."""
    first = f'<body name="a" pos="0.1 0.2 0.3"><joint name="one" axis="0 1 0"/>{GEOM}'
    second = f'<body name="b" pos="0.3 0.1 0.2" {attributes}><joint name="two" {joint}/>{inside}</body>'
    return file(first + second + "</body>", head, tail)


def masses(compiler: str, first: str, second: str = GEOM) -> str:
    return arm(inside=second, head=f"<compiler {compiler}/>").replace(GEOM, first, 1)


CHILD = '<body name="c" pos="0.1 0 0.2"><joint name="three" axis="1 1 0"/><geom size="0.1"/><site name="s"/></body>'
SITE = GEOM + '<site name="s" pos="0.1 0.2 0.3" {}/>'
INERTIAL = '<inertial pos="0.1 0.2 0.3" mass="3" {}/>'
TURNED = INERTIAL.format('diaginertia="1 1.2 1.5" euler="10 20 30"')
CLASSES = (
    '<default><joint axis="1 0 0"/><geom density="500"/><site euler="10 20 30"/>'
    '<default class="x"><joint axis="0 1 1" pos="0.1 0 0"/><geom type="box" size="0.1 0.2 0.3"/>'
    '<default class="y"><joint ref="20"/><geom mass="2"/></default></default></default>'
)
FOUR = (
    '<body name="crank"><joint name="a" axis="0 0 1" range="-60 60"/><geom size="0.02"/>'
    '<body name="coupler" pos="0 0.2 0"><joint name="b" axis="0 0 1"/><geom size="0.02"/><site name="tip" pos="0.1 0.1 0"/>'
    '<site name="e1" pos="0.35 0 0"/></body></body>'
    '<body name="rocker" pos="0.3 0 0"><joint name="c" axis="0 0 1"/><geom size="0.02"/><site name="e2" pos="0 0.25 0"/></body>'
)
DRIVEN = "<equality>{}</equality><actuator><position joint='a'/></actuator>"
BODIES = DRIVEN.format('<connect body1="coupler" body2="rocker" anchor="0.3 0.05 0"/>')

FIVE = FOUR.replace(
    '<site name="e2"',
    '<body name="far" pos="0 0.1 0"><joint name="d" axis="0 0 1"/><geom size="0.02"/></body><site name="e2"',
)

EQUAL = {
    "an inherited angle in degrees": arm('euler="30 40 50"'),
    "radians": arm('euler="0.3 0.4 0.5"', 'ref="0.3"', head='<compiler angle="radian"/>'),
    "eulerseq of fixed axes": arm('euler="30 40 50"', head='<compiler eulerseq="XYZ"/>'),
    "eulerseq of mixed axes": arm('euler="30 40 50"', head='<compiler eulerseq="zYx"/>'),
    "two compilers": arm('euler="1 2 3"', head='<compiler angle="radian"/><compiler eulerseq="zyx"/>'),
    "axisangle": arm('axisangle="1 2 3 40"'),
    "xyaxes not at a right angle": arm('xyaxes="1 1 0 0 1 1"'),
    "zaxis": arm('zaxis="1 -2 3"'),
    "zaxis straight down": arm('zaxis="0 0 -2"'),
    "quat without unit length": arm('quat="2 0.2 0.3 0.4"'),
    "meshdir": arm(head='<compiler meshdir="nowhere"/>'),
    "ref of a hinge": arm("", 'ref="25"'),
    "ref of a slide": arm("", 'ref="0.2" type="slide" axis="1 2 0"'),
    "springref": arm("", 'springref="25" stiffness="3"'),
    "a joint off the origin": arm("", 'pos="0.1 0.2 0.3" axis="1 2 3"'),
    "three joints of a body": arm(
        inside=GEOM + '<joint name="x" type="slide" axis="1 0 1" ref="0.1"/>'
        '<joint name="y" pos="0.3 0.1 0" axis="0 1 0" ref="9"/>'
    ),
    "axis without unit length": arm("", 'axis="3 4 12"'),
    "autolimits off": arm("", 'range="-10 10" limited="false"', head='<compiler autolimits="false"/>'),
    "nested classes": arm('childclass="y"', inside=f'<geom/><site name="t"/>{CHILD}', head=CLASSES),
    "a class of its own": arm('childclass="y"', 'class="x"', inside='<geom class="y"/>' + CHILD, head=CLASSES),
    "an own orientation in place of the class's": arm(inside=SITE.format('quat="1 0 0 1"'), head=CLASSES),
    "some of the class's sizes": arm(inside='<geom class="x" size="0.5"/>', head=CLASSES),
    "two defaults at the top": arm(
        inside="<geom/>", head='<default><geom size="0.2"/></default><default><geom density="7"/></default>'
    ),
    "a frame": arm(inside=f'{GEOM}<frame pos="0.1 0.2 0.3" euler="10 20 30">{CHILD}<site name="t" euler="1 2 3"/></frame>'),
    "frames in frames": arm(
        inside=f'{GEOM}<frame pos="1 0 0"><frame euler="0 0 90" childclass="x">{CHILD}</frame></frame>', head=CLASSES
    ),
    "a joint in a frame": arm(
        inside=GEOM + '<frame pos="0.1 0 0" euler="0 30 0"><joint name="j" pos="0.2 0 0" axis="1 0 2"/></frame>'
    ),
    "masses in frames": arm(inside='<frame pos="0.1 0 0" euler="0 30 0"><geom type="box" size="0.1 0.2 0.3"/></frame>'),
    "an inertial in a frame": arm(
        inside=f'<frame pos="0.1 0 0" euler="0 30 0">{TURNED}</frame>'
    ),
    "a frame on the world": file(
        f'<frame pos="0.1 0.2 0" euler="0 0 90"><body name="a"><joint name="j"/>{GEOM}{CHILD}</body></frame>'
    ),
    "a site named as its body": arm(inside=GEOM + '<site name="b" pos="0 0.1 0.2"/>'),
    "a site on the world": file(f'<site name="o" pos="1 2 3"/><body name="a"><joint name="j"/>{GEOM}</body>'),
    "a site between two points": arm(inside=GEOM + '<site name="s" type="box" size="0.1" fromto="0 0 0 1 2 3"/>'),
    "fullinertia": arm(inside=INERTIAL.format('fullinertia="1 1.2 1.5 0.1 0.2 -0.1"')),
    "diaginertia turned": arm(inside=TURNED),
    "mass in place of density": arm(inside='<geom type="box" size="0.1 0.2 0.3" mass="2" density="7"/>'),
    "a sphere": arm(inside='<geom size="0.1" pos="0.1 0.2 0"/>'),
    "a capsule": arm(inside='<geom type="capsule" size="0.1 0.2" euler="10 20 30"/>'),
    "a cylinder": arm(inside='<geom type="cylinder" size="0.1 0.2" euler="10 20 30" density="70"/>'),
    "an ellipsoid": arm(inside='<geom type="ellipsoid" size="0.1 0.2 0.3" euler="10 20 30"/>'),
    "a box": arm(inside='<geom type="box" size="0.1 0.2 0.3" euler="10 20 30"/>'),
    "a capsule between two points": arm(inside='<geom type="capsule" size="0.1" fromto="0 0 0 0.1 0.2 0.3"/>'),
    "a box between two points": arm(inside='<geom type="box" size="0.1" fromto="0 0 0 0.1 0.2 0.3"/>'),
    "an ellipsoid between two points": arm(inside='<geom type="ellipsoid" size="0.1" fromto="0 0 0 0.1 0.2 0.3"/>'),
    "several geoms": arm(
        inside='<geom size="0.1"/><geom type="box" size="0.1 0.1 0.1" pos="0.3 0 0"/><geom size="1" mass="0"/>'
    ),
    "inertiafromgeom": masses('inertiafromgeom="true"', INERTIAL.format('diaginertia="1 1 1"') + GEOM),
    "inertiafromgeom false": masses('inertiafromgeom="false"', *[INERTIAL.format('diaginertia="1 1 1"') + GEOM] * 2),
    "inertiafromgeom with geoms of other groups": masses(
        'inertiafromgeom="true" inertiagrouprange="2 3"',
        INERTIAL.format('diaginertia="1 1 1"') + GEOM,
        '<geom size="0.1" group="2"/><geom size="0.2" group="4"/>',
    ),
    "settotalmass": masses(
        'settotalmass="12"', GEOM, '<geom size="0.1"/><body name="fixed" pos="1 0 0"><geom size="0.2"/></body>'
    ),
    "boundmass and boundinertia": masses(
        'boundmass="0.5" boundinertia="0.02"', GEOM, '<geom type="box" size="0.01 0.2 0.1"/><body name="empty"/>'
    ),
    "balanceinertia": masses('balanceinertia="true"', INERTIAL.format('fullinertia="1 1 5 0.1 0.2 0.3"')),
    "settotalmass after bounds": masses('settotalmass="12" boundmass="1"', GEOM, '<geom size="0.02"/><body name="empty"/>'),
    "a body without a joint": arm(inside=f'{GEOM}<body name="tool" pos="0 0 1" euler="0 10 0">{GEOM}</body>'),
    "keyframes": arm(tail='<keyframe><key qpos="0.3 0.4"/></keyframe>'),
    "mocap": file(f'<body name="target" mocap="true" pos="1 2 3">{GEOM}</body><body name="a"><joint name="j"/>{GEOM}</body>'),
    "connect of sites": file(FOUR, "", DRIVEN.format('<connect site1="e1" site2="e2"/>')),
    "connect of bodies": file(FOUR, "", BODIES),
    "a five-bar": file(
        FIVE,
        "",
        '<equality><connect body1="coupler" body2="far" anchor="0.3 0.05 0"/></equality>'
        '<actuator><position joint="c"/><position joint="a"/><motor joint="c"/></actuator>',
    ),
    "weld of bodies": file(FIVE, "", DRIVEN.format('<weld body1="coupler" body2="far"/>')),
    "weld with a pose": file(FIVE, "", DRIVEN.format('<weld body1="far" body2="coupler" relpose="-.3 .1 0 1 0 0 .1"/>')),
    "connect that is not active": file(FOUR, "", DRIVEN.format('<connect site1="e1" site2="e2" active="false"/>')),
    "connect of a class that is not active": file(
        FOUR,
        '<default><default class="off"><equality active="false"/></default></default>',
        DRIVEN.format('<connect class="off" site1="e1" site2="e2"/>'),
    ),
    "connect that is active although its class is not": file(
        FOUR, '<default><equality active="false"/></default>', DRIVEN.format('<connect active="true" site1="e1" site2="e2"/>')
    ),
    "a joint that follows another": arm(
        "", 'ref="10"', tail='<equality><joint joint1="two" joint2="one" polycoef="0.1 -2"/></equality>'
    ),
    "a hinge held by an equality": arm("", 'ref="10"', tail='<equality><joint joint1="two" polycoef="0.3"/></equality>'),
    "a slide held by an equality": arm(
        "", 'ref="0.1" type="slide" axis="0 1 1"', tail='<equality><joint joint1="two" polycoef="0.3"/></equality>'
    ),
    "a joint whose class lets it not follow": arm(
        head='<default><equality active="false"/></default>', tail='<equality><joint joint1="two" joint2="one"/></equality>'
    ),
}  # fmt: skip

SAID = {
    "gravcomp": (arm('gravcomp="1"'), "gravcomp is not read.*: bodies b"),
    "shellinertia": (arm(inside='<geom size="0.1" shellinertia="true"/>'), "shellinertia is not read.*: bodies b"),
    "a mesh": (
        arm(
            inside='<geom type="mesh" mesh="m"/>',
            head='<asset><mesh name="m" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>',
        ),
        "masses of meshes are not read.*: bodies b",
    ),
    "a primitive that is fitted to a mesh": (
        arm(
            inside='<geom type="box" mesh="m"/>',
            head='<asset><mesh name="m" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>',
        ),
        "masses of meshes are not read.*: bodies b",
    ),
    "a ball joint": (arm("", 'type="ball"'), "joint two is of type ball"),
    "a free body": (file(f'<body name="a"><freejoint name="f"/>{GEOM}{CHILD}</body>'), "joint f has 6 degrees"),
    "replicate": (arm(inside=f'{GEOM}<replicate count="2" offset="1 0 0">{GEOM}</replicate>'), "<replicate> is not read"),
    "a weld to a mocap body": (
        file(
            f'<body name="target" mocap="true" pos="1 2 3">{GEOM}</body><body name="a"><joint name="j"/>{GEOM}</body>',
            "",
            '<equality><weld body1="target" body2="a"/></equality>',
        ),
        "equality/weld of mocap bodies is left out: target",
    ),
    "a curve": (
        arm(tail='<equality><joint joint1="two" joint2="one" polycoef="0 1 2"/></equality>'),
        "equality/joint of two is a curve",
    ),
    "a tendon's equality": (
        arm(tail='<tendon><fixed name="t"><joint joint="one" coef="1"/></fixed></tendon>'
            '<equality><tendon tendon1="t"/></equality>'),
        "equality/tendon is not read",
    ),
    "flexcomp": (
        file(
            f'<body name="a"><joint/>{GEOM}</body>'
            '<flexcomp name="f" type="grid" count="2 2 1" spacing="1 1 1" dim="2" mass="1" radius="0.01"/>'
        ),
        "<flexcomp> is not read",
    ),
}  # fmt: skip

WRONG = {
    "a negative mass of a geom": (arm(inside='<geom size="0.1" mass="-1"/>'), "a geom of b has a negative mass"),
    "a negative mass": (arm(inside='<inertial pos="0 0 0" mass="-3" diaginertia="1 1 1"/>'), "the mass of b is -3"),
    "a class that is not there": (arm('childclass="none"'), "no default class is called 'none'"),
    "two sites of one name": (arm(inside=GEOM + '<site name="s"/><site name="s"/>'), "two sites are called s"),
    "two sites that are not there": (file(FOUR, "", DRIVEN.format('<connect site1="e1" site2="crank"/>')), "unknown 'crank'"),
    "global coordinates": (arm(head='<compiler coordinate="global"/>'), "coordinate=\"global\""),
    "a mark of no body": (arm(tail='<custom><text name="gtpin_tcp" data="x"/></custom>'), "gtpin_tcp names 'x'"),
}  # fmt: skip


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes its warnings into a file in the working folder."""
    monkeypatch.chdir(tmp_path)


def loaded(text: str, folder: Path) -> gtpin.Robot:
    (folder / "robot.xml").write_text(text, encoding="utf-8")
    return gtpin.load_robot(folder / "robot.xml")


def coordinates(robot: gtpin.Robot, model: mujoco.MjModel, configuration: np.ndarray) -> np.ndarray:
    """MuJoCo's coordinates of the same posture. Joints that gtpin's model has not are where an equality holds them, or at 0."""
    qpos = np.zeros(model.nq)
    for i in range(model.njnt):
        name = model.joint(i).name
        if robot.model.existJointName(name):
            joint = robot.model.getJointId(name)
            own = configuration[robot.model.idx_qs[joint] :][: robot.model.nqs[joint]]
            qpos[i] = np.arctan2(own[1], own[0]) if len(own) == 2 else own[0]
    for i in np.flatnonzero(model.eq_active0):
        one, other = model.eq_obj1id[i], model.eq_obj2id[i]
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT and other < 0:
            qpos[one] = model.qpos0[one] + model.eq_data[i, 0]
        elif model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
            travel = qpos[other] - model.qpos0[other]
            np.testing.assert_allclose(
                np.exp(1j * qpos[one]),
                np.exp(1j * (model.qpos0[one] + np.polynomial.Polynomial(model.eq_data[i, :5])(travel))),
                rtol=0,
                atol=1e-12,
            )
    return qpos


@pytest.mark.filterwarnings("ignore:.*are open at its initial posture")
@pytest.mark.parametrize("what", EQUAL)
def test_poses_are_mujocos(what: str, tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_string(EQUAL[what])
    data = mujoco.MjData(model)
    if what == "a site named as its body":
        with pytest.warns(GtpinWarning, match="a site and a body are called b: .* the link of the body is b_body"):
            robot = loaded(EQUAL[what], tmp_path)
    else:
        robot = loaded(EQUAL[what], tmp_path)
    sites = {model.site(i).name: model.site(i).id for i in range(model.nsite)}
    bodies = {model.body(i).name: i for i in range(1, model.nbody)}
    bodies = {f"{name}_body" if name in sites else name: i for name, i in bodies.items()}
    scratch = robot.model.createData()
    home = gtpin.home(robot)
    for q in np.random.default_rng(7).uniform(-0.4, 0.4, (5, robot.n_actuators)):
        configuration = home.moved_to(q).configuration
        data.qpos[:] = coordinates(robot, model, configuration)
        mujoco.mj_forward(model, data)
        pin.framesForwardKinematics(robot.model, scratch, configuration)
        closed = data.efc_pos[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
        np.testing.assert_allclose(closed, 0.0, atol=1e-8)  # its loops are closed
        places = {name: (data.xpos[i], data.xmat[i]) for name, i in bodies.items()}
        places |= {name: (data.site_xpos[i], data.site_xmat[i]) for name, i in sites.items()}
        for name, (position, matrix) in places.items():
            frame = scratch.oMf[robot.model.getFrameId(name, pin.FrameType.BODY)]
            np.testing.assert_allclose(frame.translation, position, rtol=0, atol=1e-9, err_msg=name)
            np.testing.assert_allclose(frame.rotation, np.reshape(matrix, (3, 3)), rtol=0, atol=1e-9, err_msg=name)


@pytest.mark.filterwarnings("ignore:.*a site and a body are called", "ignore:.*are open at its initial posture")
@pytest.mark.parametrize("what", EQUAL)
def test_masses_are_mujocos(what: str, tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_string(EQUAL[what])
    robot = loaded(EQUAL[what], tmp_path)
    links = {link.get("name"): link.find("inertial") for link in fromstring(robot.description.xml).iter("link")}
    sites = {model.site(i).name for i in range(model.nsite)}
    for i in range(1, model.nbody):
        name = model.body(i).name
        found = links[f"{name}_body" if name in sites else name]
        if found is None:
            assert model.body_mass[i] == 0.0, name
            continue
        moments = {key: float(value) for key, value in found.find("inertia").attrib.items()}
        matrix = np.array([[moments["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[i])
        axes = turn.reshape(3, 3)
        assert float(found.find("mass").get("value")) == pytest.approx(model.body_mass[i], rel=1e-9)
        lever = [float(word) for word in found.find("origin").get("xyz").split()]
        np.testing.assert_allclose(lever, model.body_ipos[i], rtol=0, atol=1e-9)
        np.testing.assert_allclose(matrix, axes @ np.diag(model.body_inertia[i]) @ axes.T, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("what", SAID)
def test_what_is_not_read_is_said_by_name(what: str, tmp_path: Path) -> None:
    text, said = SAID[what]
    mujoco.MjModel.from_xml_string(text)  # MuJoCo reads it
    if "bodies" in said:
        with pytest.warns(GtpinWarning, match=said):
            loaded(text, tmp_path)
    else:
        with pytest.raises(RobotError, match=said):
            loaded(text, tmp_path)


@pytest.mark.parametrize("what", WRONG)
def test_what_mujoco_refuses_is_refused(what: str, tmp_path: Path) -> None:
    text, said = WRONG[what]
    if "gtpin" not in text:
        with pytest.raises(ValueError):  # noqa: PT011 (MuJoCo's own words)
            mujoco.MjModel.from_xml_string(text)
    with pytest.raises(RobotError, match=said):
        loaded(text, tmp_path)


SPOILT = {
    "entities": arm().replace("<mujoco", '<!DOCTYPE mujoco [<!ENTITY a "b">]><mujoco'),
    "broken": arm().replace("</worldbody>", ""),
    "nothing that moves": "<mujoco><worldbody><body/></worldbody></mujoco>",
    "an axis of no length": arm("", 'axis="0 0 0"'),
    "a place in words": arm().replace("0.1 0.2 0.3", "here"),
    "a place in two numbers": arm().replace("0.1 0.2 0.3", "1 2"),
    "a place that is not finite": arm().replace("0.1 0.2 0.3", "nan 0 0"),
    "two bodies of one name": arm(inside=CHILD.replace('"c"', '"a"')),
    "two joints of one name": arm(inside=CHILD.replace('"three"', '"one"')),
    "a loop of an unknown body": file(FOUR, "", BODIES.replace('"rocker"', '"nobody"')),
    "a loop without its place": file(FOUR, "", BODIES.replace("anchor", "at")),
    "loops but no drives": file(FOUR, "", BODIES.replace("actuator>", "other>")),
    "euler angles in an order that is none": arm(head='<compiler eulerseq="zYq"/>'),
    "a mass in words": arm(inside='<inertial pos="0 0 0" mass="heavy" diaginertia="1 1 1"/>'),
    "sizes that are negative": arm(inside='<geom size="-0.1"/>'),
}


@pytest.mark.parametrize("what", SPOILT)
def test_what_makes_no_robot_is_refused_in_one_line(
    what: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(RobotError) as caught:
        loaded(SPOILT[what], tmp_path)
    assert str(caught.value).startswith(str(tmp_path / "robot.xml"))
    assert "\n" not in str(caught.value)
    assert caught.value.hint
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("where", ["robot.xml", "deep/arm.xml"])
def test_included_files_are_found_as_mujoco_finds_them(where: str, tmp_path: Path) -> None:
    """In the folder of the main file; else beside the file that includes them."""
    (tmp_path / "deep").mkdir()
    (tmp_path / "robot.xml").write_text('<mujoco><include file="deep/arm.xml"/></mujoco>', encoding="utf-8")
    (tmp_path / "deep" / "arm.xml").write_text('<mujoco><include file="part.xml"/></mujoco>', encoding="utf-8")
    (tmp_path / "deep" / "part.xml").write_text(arm(), encoding="utf-8")
    if where == "robot.xml":
        (tmp_path / "part.xml").write_text(arm('euler="1 2 3"'), encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    home = gtpin.home(gtpin.load_robot(tmp_path / "robot.xml", tcp="b"))
    np.testing.assert_allclose(home.R, data.body("b").xmat.reshape(3, 3), rtol=0, atol=1e-12)


def test_files_that_can_not_be_included_are_refused(tmp_path: Path) -> None:
    for inside, said in (
        ("robot.xml", "included twice"),
        ("nothing.xml", r"nothing\.xml: the file is missing; mend <include>"),
    ):
        with pytest.raises(RobotError, match=said):
            loaded(f'<mujoco><include file="{inside}"/></mujoco>', tmp_path)


def test_ranges_are_in_the_unit_of_the_file(tmp_path: Path) -> None:
    ranges = '<default><joint range="-90 60"/></default>'
    for joint in ("", 'range="-10 10"', 'limited="false"', 'type="slide" range="-1 2"'):
        text = arm("", joint, head=ranges)
        robot, model = loaded(text, tmp_path), mujoco.MjModel.from_xml_string(text)
        for i, name in enumerate(robot.sites):
            limited, (low, high) = model.joint(name).limited[0], model.joint(name).range
            expected = (low, high) if limited else (-np.inf, np.inf)
            np.testing.assert_allclose((robot.lower[i], robot.upper[i]), expected, rtol=1e-12)


def test_a_loop_s_drives_are_those_of_the_file_in_its_order(tmp_path: Path) -> None:
    assert loaded(EQUAL["a five-bar"], tmp_path).sites == ("c", "a")


@pytest.mark.parametrize("what", ["connect that is not active", "connect of a class that is not active"])
def test_a_loop_that_is_not_active_leaves_the_drives_of_the_file(what: str, tmp_path: Path) -> None:
    """The passive joints of the loop rest, as in MuJoCo."""
    assert loaded(EQUAL[what], tmp_path).n_actuators == mujoco.MjModel.from_xml_string(EQUAL[what]).nu


def test_a_model_of_an_mjcf_is_written_and_read_again(tmp_path: Path) -> None:
    geometry = gtpin.Geometry.nominal(loaded(file(FOUR, "", BODIES), tmp_path))
    rng = np.random.default_rng(4)
    model = gtpin.Model(geometry.with_values(geometry.values + 1e-3 * rng.standard_normal(geometry.values.size)))
    gtpin.write_model(model, tmp_path / "model")
    q = rng.uniform(-0.3, 0.3, (5, 1))
    for name in ("", "robot.urdf"):
        assert np.abs(gtpin.read_model(tmp_path / "model" / name).predict(q).minus(model.predict(q))).max() < 1e-9


def test_gravity_is_that_of_the_last_option_unless_it_is_switched_off() -> None:
    for head in (
        '<option gravity="1 2 3"/><option gravity="0 0 -5"/>',
        '<option gravity="1 2 3"><flag gravity="disable"/></option>',
        "<option/>",
    ):
        model = mujoco.MjModel.from_xml_string(arm(head=head))
        off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        expected = np.zeros(3) if off else model.opt.gravity
        np.testing.assert_array_equal(RobotDescription.parse(arm(head=head)).gravity, expected)


def test_a_tcp_that_the_file_names_is_taken() -> None:
    text = arm(inside=GEOM + SITE.format("") + CHILD.replace('name="s"', 'name="t"'))
    assert gtpin.Robot(RobotDescription.parse(text)).tcp_frame == "c"
    for link in ("s", "a", "b"):
        marked = text.replace("</mujoco>", f'<custom><text name="gtpin_tcp" data="{link}"/></custom></mujoco>')
        mujoco.MjModel.from_xml_string(marked)
        assert gtpin.Robot(RobotDescription.parse(marked)).tcp_frame == link
    assert gtpin.Robot(RobotDescription.parse(text.replace('"s"', '"tool0"'))).tcp_frame == "tool0"


def test_a_tcp_that_is_guessed_is_told() -> None:
    two = arm(inside=GEOM + CHILD + CHILD.replace('"c"', '"d"').replace('"three"', '"four"').replace('"s"', '"t"'))
    with pytest.warns(GtpinWarning, match="names no TCP: d is taken, and there are also"):
        gtpin.Robot(RobotDescription.parse(two))
    robot = gtpin.Robot(RobotDescription.parse(two), "c")  # a warning would be an error here
    assert robot.tcp_frame == "c"
