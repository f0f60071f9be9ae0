// XYZ THREADS: tree and covariance normals; the query point counts as a neighbour, so 11.
#include <Eigen/Dense>
#include <nanoflann.hpp>
#include "clock.hpp"

struct Cloud {
    const std::vector<double>& values;
    size_t kdtree_get_point_count() const { return values.size() / 3; }
    double kdtree_get_pt(size_t point, size_t axis) const { return values[3 * point + axis]; }
    template <class Box> bool kdtree_get_bbox(Box&) const { return false; }
};

int main(int, char** arguments) {
    const auto values = positions(arguments[1]);
    const int threads = std::atoi(arguments[2]);
    const double cpu_before = cpu(), wall_before = wall();
    Cloud cloud{values};
    using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, 3>;
    Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10));
    tree.buildIndex();
    std::vector<Eigen::Vector3f> normals(cloud.kdtree_get_point_count());
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1024)
    for (size_t point = 0; point < normals.size(); ++point) {
        uint32_t neighbors[11];
        double distances[11];
        const size_t found = tree.knnSearch(&values[3 * point], 11, neighbors, distances);
        const Eigen::Vector3d center(&values[3 * point]);
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
        for (size_t i = 0; i < found; ++i) {
            const Eigen::Vector3d offset = Eigen::Vector3d(&values[3 * neighbors[i]]) - center;
            sum += offset;
            squares += offset * offset.transpose();
        }
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
        solver.computeDirect(squares - sum * sum.transpose() / found);
        normals[point] = solver.eigenvectors().col(0).cast<float>();
    }
    tell(cpu_before, wall_before);
}
