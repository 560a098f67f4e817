"""The package of the ROS 2 node, as colcon builds it; endosdk itself comes from pip."""

from setuptools import setup

setup(
    name="endosdk_ros2",
    version="0.1.0",
    packages=["endosdk_ros2"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/endosdk_ros2"]),
        ("share/endosdk_ros2", ["package.xml"]),
    ],
    install_requires=["setuptools", "endosdk[cpu,live]"],
    entry_points={"console_scripts": ["node = endosdk_ros2.node:main"]},
)
