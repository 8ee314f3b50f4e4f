#include "drivers/can/eds.h"

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "drivers/sim/sim_drive.h"
#include "tests/input_fault.h"

namespace vantage::can {
namespace {

const char* const kEds = R"(; a drive
[FileInfo]
FileName=drive.eds
[DeviceInfo]
VendorName=Somebody
ProductName=Drive 7
VendorNumber=0x56414E54
ProductNumber=1

[1018]
ParameterName=Identity object
ObjectType=0x9
SubNumber=2
[1018sub1]
ParameterName=Vendor ID
ObjectType=0x7
DataType=0x0007
AccessType=ro
PDOMapping=0
[1400sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x200
[6065]
ParameterName=Following error window
ObjectType=0x7
DataType=0x0007
AccessType=rw
LowLimit=1
HighLimit=0x3D0900
DefaultValue=4000
[607d]
ParameterName=Software position limit
ObjectType=0x8
DataType=0x0004
AccessType=rw
CompactSubObj=2
[6098]
ParameterName=Homing method
ObjectType=0x7
DataType=0x0002
AccessType=rw
LowLimit=0x80
HighLimit=0x25
DefaultValue=0
)";

TEST(Eds, TellsObjectsTypesAccessAndLimits) {
  const Eds eds = parse_eds(kEds, "drive.eds", 5);
  EXPECT_EQ(eds.vendor_name, "Somebody");
  EXPECT_EQ(eds.product_name, "Drive 7");
  EXPECT_EQ(eds.vendor, 0x56414E54U);
  const ObjectEntry& window = eds.objects.at({0x6065, 0});
  EXPECT_EQ(window.type, DataType::kUnsigned32);
  EXPECT_TRUE(window.writable);
  EXPECT_EQ(window.low_limit, 1);
  EXPECT_EQ(window.high_limit, 4'000'000);
  EXPECT_EQ(window.value, 4000);
  EXPECT_FALSE(eds.objects.at({0x1018, 1}).writable);
  EXPECT_EQ(eds.objects.at({0x1400, 1}).value, 0x205);
  EXPECT_EQ(eds.objects.at({0x607D, 2}).type, DataType::kInteger32);
  EXPECT_EQ(eds.objects.at({0x6098, 0}).low_limit, -128);  // written as the bits of its type
  EXPECT_EQ(eds.objects.count({0x1018, 0}), 0U);
}

TEST(Eds, ADcfNamesItsNodeAndItsValues) {
  const Eds dcf = parse_eds(std::string(kEds) + "ParameterValue=17\n[DeviceComissioning]\nNodeID=9\n", "drive.dcf", 5);
  EXPECT_EQ(dcf.node, 9);
  EXPECT_EQ(dcf.objects.at({0x1400, 1}).value, 0x209);
  EXPECT_EQ(dcf.objects.at({0x6098, 0}).value, 17);
}

TEST(Eds, NamesFileLineAndFault) {
  const auto fault = [](const std::string& text) { return input_fault([&] { parse_eds(text, "drive.eds"); }); };
  EXPECT_EQ(fault("[6065\n"), "drive.eds:1: a section's name ends with ]");
  EXPECT_EQ(fault("a=b\n"), "drive.eds:1: stands before the first [section]");
  EXPECT_EQ(fault("[6065]\nnonsense\n"), "drive.eds:2: expected key=value or [section]");
  EXPECT_EQ(fault("[6065]\nAccessType=rw\n"), "drive.eds:1: DataType is missing");
  EXPECT_EQ(fault("[6065]\nDataType=0x7\nLowLimit=ten\n"),
            "drive.eds:3: lowlimit: expected a number of up to 32 bits, found \"ten\"");
  EXPECT_EQ(fault("[6065]\nDataType=0x7\nLowLimit=3\nHighLimit=2\n"), "drive.eds:1: LowLimit is above HighLimit");
  EXPECT_EQ(fault("[6065]\nDataType=0x7\nLowLimit=3\nDefaultValue=2\n"),
            "drive.eds:1: its value lies outside its limits");
  EXPECT_EQ(fault("[FileInfo]\nx=1\n"), "drive.eds: describes no object; is it an EDS or DCF file?");
  EXPECT_EQ(input_fault([] { load_eds("/nonexistent.eds"); }), "/nonexistent.eds: no such file, or it can't be read");
}

TEST(Eds, TheShippedOneDescribesTheSimulatedDrive) {
  const Eds eds = load_eds(VANTAGE_SOURCE_DIR "/calib/rigs/simulated_drive.eds", 3);
  sim::SimDrive drive({.node = 3}, std::chrono::nanoseconds(0));
  const ObjectMap has = drive.dictionary().entries();
  EXPECT_EQ(eds.vendor, static_cast<std::uint32_t>(drive.dictionary().get(objects::kVendor)));
  for (const auto& [address, entry] : eds.objects) {
    const auto found = has.find(address);
    ASSERT_NE(found, has.end()) << to_text(address, eds.objects);
    EXPECT_EQ(found->second.type, entry.type) << to_text(address, eds.objects);
    EXPECT_EQ(found->second.writable, entry.writable) << to_text(address, eds.objects);
    if (size_of(entry.type) == 0) continue;
    EXPECT_EQ(found->second.low_limit, entry.low_limit) << to_text(address, eds.objects);
    EXPECT_EQ(found->second.high_limit, entry.high_limit) << to_text(address, eds.objects);
  }
  for (const auto& [address, entry] : has) EXPECT_EQ(eds.objects.count(address), 1U) << to_text(address);
}

TEST(ObjectTable, AnEdsCorrectsTheProfile) {
  const Eds eds = parse_eds("[6065]\nDataType=0x6\nAccessType=rw\n", "drive.eds");
  const ObjectMap corrected = corrected_by(profile_objects(), eds.objects);
  EXPECT_EQ(corrected.at({0x6065, 0}).type, DataType::kUnsigned16);
  EXPECT_EQ(corrected.at({0x607A, 0}).type, DataType::kInteger32);
  EXPECT_EQ(to_text({0x607A, 0}), "607A (target position)");
  EXPECT_EQ(to_text({0x60C2, 1}), "60C2:1 (cycle time, number)");
  EXPECT_EQ(to_text({0x2FFF, 0}), "2FFF");
}

}  // namespace
}  // namespace vantage::can
