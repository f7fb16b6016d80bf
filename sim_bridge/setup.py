"""Build script of the package sim_bridge."""

from setuptools import find_packages, setup

PACKAGE = 'sim_bridge'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Node: the simulated robot and room on the ROS side',
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
            'sim_bridge = sim_bridge.node:main',
        ],
    },
)
