"""Build script of the package nav_controller."""

from setuptools import find_packages, setup

PACKAGE = 'nav_controller'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Nodes: drive to waypoints and tables, and the safety stop before the wheels',
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
            'nav_controller = nav_controller.node:main',
            'safety_stop = nav_controller.safety_node:main',
        ],
    },
)
