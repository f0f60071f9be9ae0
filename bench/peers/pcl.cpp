// XYZ THREADS: tree and normals; the query point counts as a neighbour, so 11.
#include <pcl/features/normal_3d_omp.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include "clock.hpp"

int main(int, char** arguments) {
    const auto values = positions(arguments[1]);
    pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
    for (size_t i = 0; i < values.size(); i += 3) cloud->push_back({float(values[i]), float(values[i + 1]), float(values[i + 2])});
    const double cpu_before = cpu(), wall_before = wall();
    pcl::NormalEstimationOMP<pcl::PointXYZ, pcl::Normal> estimation(std::atoi(arguments[2]));
    estimation.setInputCloud(cloud);
    estimation.setSearchMethod(pcl::search::KdTree<pcl::PointXYZ>::Ptr(new pcl::search::KdTree<pcl::PointXYZ>));
    estimation.setKSearch(11);
    pcl::PointCloud<pcl::Normal> normals;
    estimation.compute(normals);
    tell(cpu_before, wall_before);
}
