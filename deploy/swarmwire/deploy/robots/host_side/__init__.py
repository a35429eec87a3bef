"""Server on a robot's host, over SSH, during one connection.

`host_session` sends this package along as a zipapp, which the host's Python runs from memory. It uses the standard
library of Python 3.11 and its own modules alone. All files are below `~/swarmwire`:

    env/<id>/               packages, unpacked; shared by all robots of the host, and never changed
    <robot>/releases/<id>/  agent, settings, certificates, unit file, and links to its packages
    <robot>/current         link to the release that starts next
    <robot>/history         releases in the order in which they became current, the newest last
    <robot>/log/            the robot's logs
"""
