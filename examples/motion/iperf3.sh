# A server on every second robot. Its neighbour sends it 1 Mbit/s in datagrams of 500 bytes.
group=${ROBOT%-*} index=$ROBOT_INDEX
if [ $((index % 2)) = 1 ]; then
    exec iperf3 --server --version4 --one-off --interval 1 --format k --forceflush
fi
sleep 1 # until the server listens
until iperf3 --client "$group-$((index + 1))" --version4 --udp --bitrate 1M --length 500 --time "${IPERF3_S:-38}"; do
    sleep 0.5 # the radio lost the connection
done
