"""What runs on a robot's host while it is served over SSH.

It is sent along, and run by the host's own Python: the standard library of Python 3.11, and nothing else but its
siblings. Everything is kept below `~/swarmwire`:

    env/<id>/               packages, unpacked: shared by all robots of the host, and never changed
    <robot>/releases/<id>/  agent, settings, certificates, unit file, and links to the packages that it runs with
    <robot>/current         link to the release that starts next
    <robot>/history         releases in the order in which they became current, the newest last
    <robot>/log/            the robot's logs
"""
