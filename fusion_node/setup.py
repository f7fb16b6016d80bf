"""Build script of the package fusion_node."""

from setuptools import find_packages, setup

PACKAGE = 'fusion_node'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Node: all measurements to the pose in the map and the transform map to odom',
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
            'fusion_node = fusion_node.node:main',
        ],
    },
)
