"""Build script of the package tablerunner_bringup."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = 'tablerunner_bringup'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Launcher, parameters, scenarios, bag recorder and player of Tablerunner',
    maintainer='Tablerunner maintainers',
    maintainer_email='maintainers@tablerunner.example',
    license='Apache-2.0',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/launch', sorted(glob('launch/*.launch.py'))),
        (f'share/{PACKAGE}/params', sorted(glob('params/*.yaml'))),
        (f'share/{PACKAGE}/scenarios', sorted(glob('scenarios/*.yaml'))),
        (f'share/{PACKAGE}/dds', sorted(glob('dds/*.xml'))),
        (f'share/{PACKAGE}/rviz', sorted(glob('rviz/*.rviz'))),
        (f'share/{PACKAGE}/foxglove', sorted(glob('foxglove/*.json'))),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    entry_points={
        # Commands that need ROS; they join the tablerunner command of the core.
        'tablerunner.commands': [
            'drive = tablerunner_bringup.drive_command:drive',
            'emulate = tablerunner_bringup.emulator.command:emulate',
            'doctor = tablerunner_bringup.doctor.command:doctor',
            'demo = tablerunner_bringup.commands:demo',
            'launch = tablerunner_bringup.commands:launch',
            'record = tablerunner_bringup.commands:record',
            'play = tablerunner_bringup.commands:play',
        ],
    },
)
