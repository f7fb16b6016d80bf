"""Build script of the package uwb_driver."""

from setuptools import find_packages, setup

PACKAGE = 'uwb_driver'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Node: UWB exchanges or a real device to calibrated ranges and a UWB-only fix',
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
            'uwb_driver = uwb_driver.node:main',
        ],
    },
)
