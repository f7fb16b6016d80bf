"""Build script of the package tablerunner_ros."""

from setuptools import find_packages, setup

PACKAGE = 'tablerunner_ros'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='What every Tablerunner node shares',
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
)
