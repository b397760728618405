//! Small valid objects, as text.

pub const URDF: &str = r#"<?xml version="1.0"?>
<robot name="chest">
  <material name="wood"><color rgba="0.5 0.3 0.1 1"/></material>
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual name="a"><origin xyz="0 0 0.1" rpy="0 0 0.5"/><geometry><box size="0.3 0.2 0.1"/></geometry>
      <material name="wood"/></visual>
    <visual><geometry><cylinder radius="0.1" length="0.2"/></geometry></visual>
    <visual><geometry><sphere radius="0.1"/></geometry></visual>
  </link>
  <link name="lid"><visual><geometry><mesh filename="lid.obj" scale="1 1 2"/></geometry></visual></link>
  <link name="knob"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="lid"/>
    <origin xyz="0 0.1 0.2" rpy="0 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="1.9" effort="1" velocity="1"/>
  </joint>
  <joint name="turn" type="continuous"><parent link="lid"/><child link="knob"/><axis xyz="0 0 1"/></joint>
</robot>
"#;

pub const MJCF: &str = r#"<mujoco model="chest">
  <compiler angle="degree" autolimits="true"/>
  <default><geom rgba="0.5 0.3 0.1 1"/><default class="felt"><geom type="box"/></default></default>
  <asset>
    <mesh name="lid" file="lid.obj" scale="1 1 2"/>
    <texture type="2d" name="print" file="color.png"/>
    <material name="wood" texture="print" rgba="1 1 1 1"/>
  </asset>
  <worldbody>
    <body name="chest" pos="0 0 0">
      <geom name="foot" type="cylinder" size="0.012 0.004" pos="-0.13 -0.08 0.004" density="600"/>
      <geom name="rod" type="cylinder" size="0.003" fromto="-0.1 0.1 0.12 0.1 0.1 0.12"/>
      <geom class="felt" size="0.15 0.1 0.05" euler="0 0 30"/>
      <geom type="capsule" size="0.05 0.1" quat="0.7 0.7 0 0" material="wood"/>
      <geom type="ellipsoid" size="0.05 0.1 0.1" axisangle="0 0 1 30"/>
      <body name="lid" pos="0 0 0.123">
        <joint name="lid_hinge" type="hinge" pos="0 0.104 -0.0015" axis="-1 0 0" range="0 109" damping="0.15"/>
        <geom type="mesh" mesh="lid"/>
        <body name="knob"><joint type="slide" axis="0 0 1" range="0 0.1"/><geom type="sphere" size="0.1"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
"#;

pub const OBJ: &str = "mtllib lid.mtl\no lid\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n\
usemtl wood\nf 1/1/1 2/2/1 3/3/1\nf 1//1 3//1 4//1\nf -4 -3 -2 -1\ng other\nusemtl none\nf 1 2 4\n";

pub const MTL: &str =
    "newmtl wood\nKa 0 0 0\nKd 0.5 0.3 0.1\nNs 10\nd 1.0\nillum 2\nmap_Kd color.png\nnewmtl plain\nKd 1 1 1\n";

/// A link for each kind of mesh that is not OBJ.
pub const MESHES: &str = r#"<robot name="meshes">
  <link name="a"><visual><geometry><mesh filename="a.stl"/></geometry></visual>
    <visual><geometry><mesh filename="a.dae"/></geometry></visual>
    <visual><geometry><mesh filename="a.gltf"/></geometry></visual></link>
</robot>
"#;

pub const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n\
endfacet\nendsolid a\n";

pub const DAE: &str = r##"<?xml version="1.0" encoding="utf-8"?>
<COLLADA version="1.4.1"><asset><unit meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_effects><effect id="fx"><profile_COMMON><technique sid="c"><lambert><diffuse><color>1 0 0 1</color></diffuse>
</lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#fx"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array>
<technique_common><accessor source="#pa" count="3" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><polylist material="m" count="1">
<input semantic="VERTEX" source="#v" offset="0"/><vcount>3</vcount><p>0 1 2</p></polylist></mesh></geometry></library_geometries>
<library_nodes><node id="n"><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="s"><node><rotate>0 0 1 90</rotate><node><translate>1 2 3</translate>
<instance_geometry url="#g"/><instance_node url="#n"/></node></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"##;

pub const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
"nodes":[{"translation":[0,0,1],"children":[1]},{"mesh":0,"scale":[2,1,1]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],
"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0,1],"baseColorTexture":{"index":0}}}],
"textures":[{"source":0}],"images":[{"uri":"color.png"}],
"buffers":[{"byteLength":44,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA="}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}]}
"#;
