"""The twin as an object of robosuite 1.5: put it into a task as any of robosuite's own.

    from robosuite_object import Twin
    twin = Twin("cabinet")           # stands still; Twin("cabinet", joints="default") falls
    task = ManipulationTask(mujoco_arena=arena, mujoco_robots=[robot], mujoco_objects=[twin])

Metres, z up; the middle of its foot is the origin of its body. robosuite keeps neither `<contact>` nor
`<equality>` of an object: parts do not overlap, so nothing is lost by the first; joints that follow
others move by themselves here.
"""

import pathlib

from robosuite.models.objects import MujocoXMLObject


class Twin(MujocoXMLObject):
    def __init__(self, name, joints=None):
        """joints: None, it is part of the world; "default": it has a free joint."""
        file = str(pathlib.Path(__file__).resolve().parent / "robosuite.xml")
        super().__init__(file, name=name, joints=joints, obj_type="all", duplicate_collision_geoms=False)

    @property
    def hinges(self):
        """Names of its own joints in the compiled model, in the order of twin.json."""
        return [self.naming_prefix + name for name in JOINTS]


