// IN OUT normals K: unit normals of the points, three doubles each, as the positions in IN, of K
// neighbours besides the point itself. IN OUT normal-space COUNT, or IN OUT covariance COUNT: the
// places of COUNT points that are kept, as 32-bit numbers, with normals of 10 neighbours.
#include <pcl/features/normal_3d.h>
#include <pcl/filters/covariance_sampling.h>
#include <pcl/filters/normal_space.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

using Cloud = pcl::PointCloud<pcl::PointNormal>;

// Positions less the first one: PCL holds 32-bit floats.
static Cloud::Ptr read(const char* path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    std::vector<double> values(file.tellg() / sizeof(double));
    file.seekg(0);
    file.read(reinterpret_cast<char*>(values.data()), values.size() * sizeof(double));
    Cloud::Ptr cloud(new Cloud);
    for (size_t i = 0; i + 2 < values.size(); i += 3) {
        pcl::PointNormal point;
        point.x = static_cast<float>(values[i] - values[0]);
        point.y = static_cast<float>(values[i + 1] - values[1]);
        point.z = static_cast<float>(values[i + 2] - values[2]);
        cloud->push_back(point);
    }
    return cloud;
}

static void estimate(const Cloud::Ptr& cloud, int k) {
    pcl::NormalEstimation<pcl::PointNormal, pcl::PointNormal> estimation;
    estimation.setInputCloud(cloud);
    estimation.setSearchMethod(pcl::search::KdTree<pcl::PointNormal>::Ptr(new pcl::search::KdTree<pcl::PointNormal>));
    estimation.setKSearch(k + 1);
    Cloud normals;
    estimation.compute(normals);
    for (size_t i = 0; i < cloud->size(); ++i) {
        (*cloud)[i].normal_x = normals[i].normal_x;
        (*cloud)[i].normal_y = normals[i].normal_y;
        (*cloud)[i].normal_z = normals[i].normal_z;
    }
}

int main(int, char** arguments) {
    const auto cloud = read(arguments[1]);
    const std::string kind = arguments[3];
    const int number = std::atoi(arguments[4]);
    std::ofstream out(arguments[2], std::ios::binary);
    estimate(cloud, kind == "normals" ? number : 10);
    if (kind == "normals") {
        for (const auto& point : *cloud) {
            const double normal[] = {point.normal_x, point.normal_y, point.normal_z};
            out.write(reinterpret_cast<const char*>(normal), sizeof normal);
        }
        return 0;
    }
    pcl::Indices kept;
    if (kind == "normal-space") {
        pcl::NormalSpaceSampling<pcl::PointNormal, pcl::PointNormal> sampling;
        sampling.setInputCloud(cloud);
        sampling.setNormals(cloud);
        sampling.setBins(16, 16, 16);
        sampling.setSeed(7);
        sampling.setSample(number);
        sampling.filter(kept);
    } else {
        pcl::CovarianceSampling<pcl::PointNormal, pcl::PointNormal> sampling;
        sampling.setInputCloud(cloud);
        sampling.setNormals(cloud);
        sampling.setNumberOfSamples(number);
        sampling.filter(kept);
    }
    for (const auto place : kept) {
        const auto index = static_cast<std::int32_t>(place);
        out.write(reinterpret_cast<const char*>(&index), sizeof index);
    }
}
