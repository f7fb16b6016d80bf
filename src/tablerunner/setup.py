"""Build script of the package tablerunner."""

from setuptools import find_packages, setup

PACKAGE = 'tablerunner'

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Core library of the Tablerunner delivery robot, without ROS',
    maintainer='Tablerunner maintainers',
    maintainer_email='maintainers@tablerunner.example',
    license='Apache-2.0',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={PACKAGE: ['py.typed', '**/*.yaml', '**/*.json', '**/*.csv', '**/*.msg']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
    ],
    install_requires=[
        'setuptools',
        'numpy',
        'scipy',
        'pyyaml',
        'matplotlib',
        'rich',
        'filterpy',
        'opencv-python-headless',
        'pyserial',
        'rosbags',
        'typer',
    ],
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'tablerunner = tablerunner.cli.main:main',
        ],
    },
)
