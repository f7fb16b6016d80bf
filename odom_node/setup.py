"""Build script of the package odom_node."""

from setuptools import find_packages, setup

PACKAGE = 'odom_node'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Node: wheel encoders and IMU to odom and the transform odom to base_link',
    maintainer='Tablerunner maintainers',
    maintainer_email='maintainers@tablerunner.example',
    license='Apache-2.0',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'odom_node = odom_node.node:main',
            'sensor_frames = odom_node.frames_node:main',
        ],
    },
)
