// A network of ns-3 3.44: nodes at given places, or of a movement file of ns-2, hand packets to their MAC at given times.
//
// `simulate` takes and returns text, so that Python calls it inside ns-3's wheel (cppyy compiles this file) and a
// program linked with another build of ns-3 reads standard input (-DPROGRAM).
//
// Everything that is not set here is ns-3's default: log-distance loss with exponent 3 and 46.6777 dB at 1 m, the speed
// of light, table-based errors of OFDM, detection of preambles above 4 dB and -82 dBm, queues of 500 packets and 500 ms.

#include <cstring>
#include <ctime>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "ns3/core-module.h"
#include "ns3/lr-wpan-module.h"
#include "ns3/mobility-module.h"
#include "ns3/network-module.h"
#include "ns3/propagation-module.h"
#include "ns3/wifi-module.h"

namespace validation
{

using namespace ns3;

struct Packets // of all nodes, in the order of their times
{
    std::vector<uint32_t> sender, sequence;
    std::vector<int32_t> to; // -1: all
    std::vector<int64_t> at;
};

struct Run
{
    std::string standard, mode; // "802.15.4", or "802.11a" and the like with one of ns-3's modes
    std::string manager;        // of rates: what ns-3 calls it without "WifiManager"
    uint32_t ampdu, rts;        // of 802.11n, in bytes: the greatest A-MPDU, and the size above which RTS/CTS precedes
    uint32_t seed, nodes, payload;
    uint32_t first, last;   // sequence numbers that count, the last one excluded
    int64_t from, until;    // in ns: when they count, too, the end excluded
    uint32_t ticks;         // of positions; 0: those of a movement file
    std::string trace;      // the movement file
    double endS, tickS;
    std::vector<double> x, y; // in m, of each tick and node
    Packets packets;
};

Run
Read(std::istream& in)
{
    Run run;
    size_t packets;
    in >> run.standard >> run.mode >> run.manager >> run.ampdu >> run.rts;
    in >> run.seed >> run.nodes >> run.payload;
    in >> run.first >> run.last >> run.from >> run.until >> run.endS >> run.ticks >> run.tickS >> packets;
    run.x.resize(run.ticks * run.nodes);
    run.y.resize(run.x.size());
    for (size_t i = 0; i < run.x.size(); i++)
    {
        in >> run.x[i] >> run.y[i];
    }
    if (run.ticks == 0)
    {
        in >> std::quoted(run.trace);
    }
    Packets& all = run.packets;
    all.sender.resize(packets);
    all.sequence.resize(packets);
    all.to.resize(packets);
    all.at.resize(packets);
    for (size_t i = 0; i < packets; i++)
    {
        in >> all.sender[i] >> all.sequence[i] >> all.to[i] >> all.at[i];
    }
    return run;
}

// What each node received of each other one; a packet that comes twice, since its acknowledgement was lost, counts once.
struct Received
{
    const Run& run;
    std::vector<uint32_t> count; // by sender x nodes + receiver
    std::vector<int64_t> delay;  // their sum, in ns
    std::vector<int64_t> newest; // sequence number
    std::vector<uint32_t> log;   // with a movement file: index and receiver of each packet

    explicit Received(const Run& of)
        : run(of),
          count(of.nodes * of.nodes),
          delay(count.size()),
          newest(count.size(), -1)
    {
    }

    void Take(uint32_t receiver, Ptr<const Packet> packet)
    {
        uint32_t index;
        packet->CopyData(reinterpret_cast<uint8_t*>(&index), sizeof(index));
        const Packets& all = run.packets;
        size_t pair = all.sender[index] * run.nodes + receiver;
        if (all.sequence[index] <= newest[pair])
        {
            return;
        }
        newest[pair] = all.sequence[index];
        int64_t now = Simulator::Now().GetNanoSeconds();
        bool counts = all.sequence[index] >= run.first && all.sequence[index] < run.last;
        if (counts && now >= run.from && now < run.until)
        {
            count[pair]++;
            delay[pair] += now - all.at[index];
            if (!run.trace.empty())
            {
                log.insert(log.end(), {index, receiver});
            }
        }
    }
};

Ptr<Packet>
Payload(const Run& run, uint32_t index)
{
    std::vector<uint8_t> bytes(run.payload);
    std::memcpy(bytes.data(), &index, sizeof(index));
    return Create<Packet>(bytes.data(), bytes.size());
}

bool
FromDevice(Received* received, uint32_t node, Ptr<NetDevice>, Ptr<const Packet> packet, uint16_t, const Address&)
{
    received->Take(node, packet);
    return true;
}

void
FromMac(Received* received, uint32_t node, lrwpan::McpsDataIndicationParams, Ptr<Packet> packet)
{
    received->Take(node, packet);
}

void
SendByWifi(const Run* run, const NetDeviceContainer* devices, uint32_t index)
{
    int32_t to = run->packets.to[index];
    Ptr<NetDevice> device = devices->Get(run->packets.sender[index]);
    device->Send(Payload(*run, index), to < 0 ? device->GetBroadcast() : devices->Get(to)->GetAddress(), 0x88b5);
}

void
SendByLrWpan(const Run* run, const NetDeviceContainer* devices, uint32_t index)
{
    int32_t to = run->packets.to[index];
    lrwpan::McpsDataRequestParams request;
    request.m_dstPanId = 1;
    request.m_dstAddr = to < 0 ? Mac16Address("ff:ff") : Mac16Address(uint16_t(to + 1));
    request.m_txOptions = to < 0 ? lrwpan::TX_OPTION_NONE : lrwpan::TX_OPTION_ACK;
    auto device = DynamicCast<lrwpan::LrWpanNetDevice>(devices->Get(run->packets.sender[index]));
    device->GetMac()->McpsDataRequest(request, Payload(*run, index));
}

NetDeviceContainer
LrWpan(LrWpanHelper& helper, const NodeContainer& nodes, Received& received)
{
    NetDeviceContainer devices = helper.Install(nodes);
    for (uint32_t i = 0; i < devices.GetN(); i++)
    {
        Ptr<lrwpan::LrWpanMac> mac = DynamicCast<lrwpan::LrWpanNetDevice>(devices.Get(i))->GetMac();
        mac->SetPanId(1);
        mac->SetShortAddress(Mac16Address(uint16_t(i + 1)));
        mac->SetMcpsDataIndicationCallback(MakeBoundCallback(&FromMac, &received, i));
    }
    return devices;
}

NetDeviceContainer
Wifi(const NodeContainer& nodes, const Run& run, Received& received)
{
    auto channel = CreateObject<YansWifiChannel>();
    channel->SetPropagationLossModel(CreateObject<LogDistancePropagationLossModel>());
    channel->SetPropagationDelayModel(CreateObject<ConstantSpeedPropagationDelayModel>());
    YansWifiPhyHelper phy;
    phy.SetChannel(channel);
    WifiMacHelper mac; // 802.11n has QoS, and packets without a priority are best effort
    mac.SetType("ns3::AdhocWifiMac", "BE_MaxAmpduSize", UintegerValue(run.ampdu));
    WifiHelper wifi;
    std::map<std::string, WifiStandard> standards{{"802.11a", WIFI_STANDARD_80211a},
                                                  {"802.11b", WIFI_STANDARD_80211b},
                                                  {"802.11g", WIFI_STANDARD_80211g},
                                                  {"802.11n", WIFI_STANDARD_80211n}};
    wifi.SetStandard(standards.at(run.standard));
    if (run.standard == "802.11n")
    {
        phy.Set("ChannelSettings", StringValue("{36, 20, BAND_5GHZ, 0}"));
    }
    // RTS and broadcasts of 802.11n have OFDM's lowest rate, which stations that know no MCS decode, too.
    StringValue mode(run.mode), control(run.standard == "802.11n" ? "OfdmRate6Mbps" : run.mode);
    std::string manager = "ns3::" + run.manager + "WifiManager";
    UintegerValue rts(run.rts);
    if (run.manager == "ConstantRate")
    {
        wifi.SetRemoteStationManager(manager, "RtsCtsThreshold", rts, "NonUnicastMode", control, "DataMode", mode, "ControlMode", control);
    }
    else
    {
        wifi.SetRemoteStationManager(manager, "RtsCtsThreshold", rts, "NonUnicastMode", control);
    }
    NetDeviceContainer devices = wifi.Install(phy, mac, nodes);
    for (uint32_t i = 0; i < devices.GetN(); i++)
    {
        devices.Get(i)->SetReceiveCallback(MakeBoundCallback(&FromDevice, &received, i));
    }
    return devices;
}

void
Place(const Run* run, const NodeContainer* nodes, uint32_t tick)
{
    for (uint32_t i = 0; i < run->nodes; i++)
    {
        size_t at = tick * run->nodes + i;
        nodes->Get(i)->GetObject<MobilityModel>()->SetPosition(Vector(run->x[at], run->y[at], 0.0));
    }
}

// The place of a packet's sender when it hands it over.
void
Sample(const Run* run, const NodeContainer* nodes, std::vector<Vector>* places, uint32_t index)
{
    (*places)[index] = nodes->Get(run->packets.sender[index])->GetObject<MobilityModel>()->GetPosition();
}

// Seconds of CPU time that the events took, then count and sum of delays in ns for each sender and receiver. With
// a movement file also the place of the sender of each packet, and index and receiver of each packet that counts.
std::string
simulate(const std::string& text)
{
    std::istringstream in(text);
    const Run run = Read(in);
    RngSeedManager::SetSeed(1);
    RngSeedManager::SetRun(run.seed);
    RngSeedManager::ResetNextStreamIndex(); // so that a run is the same, whatever ran before it
    NodeContainer nodes;
    nodes.Create(run.nodes);
    if (run.ticks == 0)
    {
        Ns2MobilityHelper(run.trace).Install(nodes.Begin(), nodes.End());
    }
    else
    {
        for (uint32_t i = 0; i < run.nodes; i++)
        {
            nodes.Get(i)->AggregateObject(CreateObject<ConstantPositionMobilityModel>());
        }
        Place(&run, &nodes, 0);
    }
    for (uint32_t tick = 1; tick < run.ticks; tick++)
    {
        Simulator::Schedule(Seconds(tick * run.tickS), &Place, &run, &nodes, tick);
    }
    std::vector<Vector> places(run.ticks == 0 ? run.packets.at.size() : 0);
    for (uint32_t i = 0; i < places.size(); i++)
    {
        Simulator::Schedule(NanoSeconds(run.packets.at[i]), &Sample, &run, &nodes, &places, i);
    }
    Received received(run);
    std::unique_ptr<LrWpanHelper> lrwpan; // it ends its channel when it goes
    if (run.standard == "802.15.4")
    {
        lrwpan = std::make_unique<LrWpanHelper>();
    }
    NetDeviceContainer devices = lrwpan ? LrWpan(*lrwpan, nodes, received) : Wifi(nodes, run, received);
    for (uint32_t i = 0; i < run.packets.at.size(); i++)
    {
        uint32_t sender = nodes.Get(run.packets.sender[i])->GetId();
        Simulator::ScheduleWithContext(sender, NanoSeconds(run.packets.at[i]), lrwpan ? &SendByLrWpan : &SendByWifi, &run, &devices, i);
    }
    Simulator::Stop(Seconds(run.endS));
    std::clock_t begin = std::clock();
    Simulator::Run();
    double cpuS = double(std::clock() - begin) / CLOCKS_PER_SEC;
    Simulator::Destroy();
    std::ostringstream out;
    out << cpuS;
    for (size_t pair = 0; pair < received.count.size(); pair++)
    {
        out << " " << received.count[pair] << " " << received.delay[pair];
    }
    out << std::setprecision(15);
    for (const Vector& place : places)
    {
        out << " " << place.x << " " << place.y;
    }
    for (uint32_t word : received.log)
    {
        out << " " << word;
    }
    return out.str();
}

} // namespace validation

#ifdef PROGRAM
int
main()
{
    std::string text{std::istreambuf_iterator<char>(std::cin), std::istreambuf_iterator<char>()};
    std::cout << validation::simulate(text) << std::endl;
    return 0;
}
#endif
