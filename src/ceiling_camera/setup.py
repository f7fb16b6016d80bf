"""Build script of the package ceiling_camera."""

from setuptools import find_packages, setup

PACKAGE = 'ceiling_camera'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Node: pictures of a camera under the ceiling to poses of robots',
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
            'ceiling_camera = ceiling_camera.node:main',
        ],
    },
)
